"""Left turns on country roads, across fast traffic.

Source: Bench2Drive `scenario_runner/srunner/scenarios/actor_flow.py` (`InterurbanActorFlow`,
`InterurbanAdvancedActorFlow`).
"""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded.scenarios.highway import flow_in_last_lane
from pytest_drive_robust.simulators.embedded.scenarios.junction_parts import end_behind_junction, route_flow
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = ["interurban_actor_flow", "interurban_advanced_actor_flow"]

_START_MPS = 8.0


@scenario(
    "InterurbanActorFlow",
    sites=(
        Site("RuralTee", "E.left0", (115.0, 134.0), trigger_m=(4.0, 12.0), before_m=(55.0, 70.0)),
        Site("RuralCrossing", "W.left0", (115.0, 134.0), trigger_m=(4.0, 12.0), before_m=(55.0, 70.0)),
    ),
    parameters={"flow_speed": (15.0, 16.0)},
    intervals={"source_dist_interval": (42.0, 98.0)},
    blocked_test_off=True,
)
def interurban_actor_flow(stage: Stage) -> None:
    """Turn left off a country road, across the flow that comes the other way.

    Where the road parts without a junction, the flow is in the lane beside the ego's that has to be crossed.
    """
    stage.start_mps = _START_MPS
    if stage.dense.first_junction_row() is None:
        flow_in_last_lane(stage, speed_mps=(15.0, 16.0), gap_m=(42.0, 98.0))
        return
    route_flow(
        stage,
        stage.from_arm("opposite"),
        speed_mps=(15.0, 16.0),
        gap_m=(42.0, 98.0),
        meets_ahead_m=stage.junction_ahead_m(),
    )
    end_behind_junction(stage)


@scenario(
    "InterurbanAdvancedActorFlow",
    sites=(
        Site("RuralTee", "S.left0", (128.0, 148.0), trigger_m=(4.0, 12.0), before_m=(50.0, 65.0)),
        Site("RuralCrossing", "N.left0", (128.0, 148.0), trigger_m=(4.0, 12.0), before_m=(50.0, 65.0)),
        Site("RuralCrossing", "S.left0", (128.0, 148.0), trigger_m=(4.0, 12.0), before_m=(50.0, 65.0)),
    ),
    parameters={"flow_speed": (16.0, 18.0)},
    intervals={"source_dist_interval": (36.0, 94.0)},
    blocked_test_off=True,
)
def interurban_advanced_actor_flow(stage: Stage) -> None:
    """Turn left onto a country road: cross the flow from the left, join the one from the right.

    Where the roads meet without a junction, there is the one flow of the route file to join.
    """
    stage.start_mps = _START_MPS
    if stage.dense.first_junction_row() is None:
        flow_in_last_lane(stage, speed_mps=(16.0, 18.0), gap_m=(36.0, 94.0))
        return
    for bearing in ("left", "right"):
        route_flow(
            stage,
            stage.from_arm(bearing),
            speed_mps=(16.0, 18.0),
            gap_m=(36.0, 94.0),
            meets_ahead_m=stage.junction_ahead_m(),
        )
    end_behind_junction(stage, metres=30.0)
