"""A junction to be turned at: lights, stop signs, flows."""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.signals import red_then_green
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = [
    "non_signalized_right_turn",
    "signalized_left_turn",
    "vanilla_red_light",
    "vanilla_stop_sign",
]

_RED_S = 5.0
_BEFORE_M = (30.0, 40.0)


@scenario(
    "SignalizedJunctionLeftTurn",
    sites=(
        Site("LightCrossing", "E.left0", (75.0, 90.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
        Site("LightAvenueCrossing", "N.left0", (80.0, 95.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (9.0, 11.0)},
    intervals={"source_dist_interval": (15.0, 28.0)},
    blocked_test_off=True,
)
def signalized_left_turn(stage: Stage) -> None:
    """Turn left across an oncoming flow; the light is red for five seconds, then green for both."""
    stage.lights(ego=red_then_green(_RED_S), opposite=red_then_green(_RED_S))
    _flow(stage, stage.from_arm("opposite"), (9.0, 11.0))
    stage.end_m = stage.trigger_m + stage.junction_ahead_m() + 30.0


@scenario(
    "NonSignalizedJunctionRightTurn",
    sites=(
        Site("OpenCrossing", "E.right0", (70.0, 85.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
        Site("OpenCrossing", "W.right0", (70.0, 85.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
    ),
    parameters={"flow_speed": (8.0, 12.0)},
    intervals={"source_dist_interval": (16.0, 30.0)},
    blocked_test_off=True,
)
def non_signalized_right_turn(stage: Stage) -> None:
    """Turn right into a flow that comes from the left; nobody stops for you."""
    _flow(stage, stage.from_arm("left"), (8.0, 12.0))
    stage.end_m = stage.trigger_m + stage.junction_ahead_m() + 30.0


@scenario(
    "VanillaSignalizedTurnEncounterRedLight",
    sites=(
        Site("LightCrossing", "S.right0", (55.0, 70.0), trigger_m=(3.0, 6.0), before_m=(28.0, 36.0)),
        Site("LightCrossing", "N.left0", (60.0, 75.0), trigger_m=(3.0, 6.0), before_m=(28.0, 36.0)),
    ),
)
def vanilla_red_light(stage: Stage) -> None:
    """A plain turn; the light is red for five seconds, then green."""
    stage.lights(ego=red_then_green(_RED_S), opposite=red_then_green(_RED_S))
    stage.end_m = stage.trigger_m + stage.junction_ahead_m() + 25.0


@scenario(
    "VanillaNonSignalizedTurnEncounterStopsign",
    sites=(
        Site("StopCrossing", "E.right0", (55.0, 70.0), trigger_m=(3.0, 6.0), before_m=(28.0, 36.0)),
        Site("StopCrossing", "W.left0", (60.0, 75.0), trigger_m=(3.0, 6.0), before_m=(28.0, 36.0)),
    ),
)
def vanilla_stop_sign(stage: Stage) -> None:
    """A plain turn behind a stop sign: come to rest, then go."""
    stage.end_m = stage.trigger_m + stage.junction_ahead_m() + 25.0


def _flow(stage: Stage, path: int, speed_mps: tuple[float, float]) -> None:
    """The flow of the route file: constant speed, gaps drawn from its interval, from edge to edge of the town."""
    gaps = (
        stage.spec.number("source_dist_interval", 16.0, attribute="from"),
        stage.spec.number("source_dist_interval", 28.0, attribute="to"),
    )
    speed = stage.spec.number("flow_speed", sum(speed_mps) / 2.0)
    stage.flow(path, speed_mps=speed, gap_m=gaps)
