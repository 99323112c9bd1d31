"""A flow of traffic at a junction that does not stop for the ego: cross it or join it through a gap.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{signalized,non_signalized}_junction_{left,right}_turn.py`,
`cross_bicycle_flow.py`, `actor_flow.py`.
"""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.scenarios.junction_parts import (
    RED_S,
    end_behind_junction,
    route_flow,
)
from pytest_drive_robust.simulators.embedded.signals import GREEN, red_then_green
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = [
    "enter_actor_flow",
    "non_signalized_left_turn",
    "non_signalized_left_turn_enter_flow",
    "non_signalized_right_turn",
    "signalized_left_turn",
    "signalized_left_turn_enter_flow",
    "signalized_right_turn",
]

_BEFORE_M = (30.0, 40.0)
_TRIGGER_M = (3.0, 8.0)


@scenario(
    "SignalizedJunctionLeftTurn",
    sites=(
        Site("LightCrossing", "E.left0", (75.0, 90.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("LightAvenueCrossing", "N.left0", (80.0, 95.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("LightTee", "E.left0", (72.0, 88.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("Grid", "W1.left0", (70.0, 80.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (9.0, 11.0)},
    intervals={"source_dist_interval": (15.0, 28.0)},
    blocked_test_off=True,
)
def signalized_left_turn(stage: Stage) -> None:
    """Turn left across an oncoming flow; the ego's light is red for five seconds, the flow's is green all the time."""
    stage.lights(ego=red_then_green(RED_S), opposite=GREEN)
    route_flow(
        stage,
        stage.from_arm("opposite"),
        speed_mps=(9.0, 11.0),
        gap_m=(15.0, 28.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "SignalizedJunctionLeftTurnEnterFlow",
    sites=(
        Site("LightCrossing", "W.left0", (75.0, 92.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("LightTee", "E.left0", (75.0, 90.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("Grid", "W1.left0", (70.0, 80.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (8.0, 10.0)},
    intervals={"source_dist_interval": (15.0, 30.0)},
    blocked_test_off=True,
)
def signalized_left_turn_enter_flow(stage: Stage) -> None:
    """Turn left and join the oncoming flow that turns right into the same exit; red for five seconds, then green."""
    stage.lights(ego=red_then_green(RED_S), opposite=GREEN)
    route_flow(
        stage,
        stage.from_arm("opposite", into="exit"),
        speed_mps=(8.0, 10.0),
        gap_m=(15.0, 30.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "SignalizedJunctionRightTurn",
    sites=(
        Site("LightCrossing", "N.right0", (68.0, 82.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("LightAvenueCrossing", "E.right1", (70.0, 85.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("LightTee", "S.right0", (68.0, 82.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("Grid", "E0.right0", (66.0, 78.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (10.0, 14.0)},
    intervals={"source_dist_interval": (19.0, 38.0)},
    blocked_test_off=True,
)
def signalized_right_turn(stage: Stage) -> None:
    """Turn right into a flow from the left, which keeps its green; the ego's light is red for five seconds first."""
    stage.lights(ego=red_then_green(RED_S), opposite=red_then_green(RED_S), crossing=GREEN)
    route_flow(
        stage,
        stage.from_arm("left", into="exit"),
        speed_mps=(10.0, 14.0),
        gap_m=(19.0, 38.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "NonSignalizedJunctionLeftTurn",
    sites=(
        Site("OpenCrossing", "S.left0", (72.0, 88.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("OpenTee", "E.left0", (72.0, 88.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("RuralTee", "E.left0", (78.0, 92.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (8.0, 11.0)},
    intervals={"source_dist_interval": (15.0, 30.0)},
    blocked_test_off=True,
)
def non_signalized_left_turn(stage: Stage) -> None:
    """Turn left across an oncoming flow; no light holds it back."""
    route_flow(
        stage,
        stage.from_arm("opposite"),
        speed_mps=(8.0, 11.0),
        gap_m=(15.0, 30.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "NonSignalizedJunctionLeftTurnEnterFlow",
    sites=(
        Site("OpenCrossing", "N.left0", (74.0, 90.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("OpenTee", "E.left0", (74.0, 90.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("RuralTee", "E.left0", (78.0, 94.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (8.0, 10.0)},
    intervals={"source_dist_interval": (15.0, 30.0)},
    blocked_test_off=True,
)
def non_signalized_left_turn_enter_flow(stage: Stage) -> None:
    """Turn left and join the oncoming flow that turns right into the same exit."""
    route_flow(
        stage,
        stage.from_arm("opposite", into="exit"),
        speed_mps=(8.0, 10.0),
        gap_m=(15.0, 30.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "NonSignalizedJunctionRightTurn",
    sites=(
        Site("OpenCrossing", "E.right0", (68.0, 82.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("OpenTee", "S.right0", (68.0, 82.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("OpenCrossing", "W.right0", (68.0, 82.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("RuralTee", "S.right0", (70.0, 86.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (8.0, 14.0)},
    intervals={"source_dist_interval": (16.0, 30.0)},
    blocked_test_off=True,
)
def non_signalized_right_turn(stage: Stage) -> None:
    """Turn right into a flow that comes from the left; nobody stops for you."""
    route_flow(
        stage,
        stage.from_arm("left", into="exit"),
        speed_mps=(8.0, 14.0),
        gap_m=(16.0, 30.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "EnterActorFlow",
    sites=(
        Site("RuralTee", "S.right0", (76.0, 92.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("RuralCrossing", "N.right0", (76.0, 92.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
        Site("LightTee", "S.right0", (74.0, 90.0), trigger_m=_TRIGGER_M, before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (12.0, 19.0)},
    intervals={"source_dist_interval": (17.0, 39.0)},
    blocked_test_off=True,
)
def enter_actor_flow(stage: Stage) -> None:
    """Turn into a fast flow from the left, or from where the file says; where there are lights, both have green."""
    stage.lights(ego=GREEN, opposite=GREEN, crossing=GREEN)
    given = stage.given_flow()
    route_flow(
        stage,
        stage.from_arm("left", into="exit") if given is None else given,
        speed_mps=(12.0, 19.0),
        gap_m=(17.0, 39.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)
