"""Bicycles on their own lane beside the road: who turns must let them go straight on."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind, LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.map import follow, join
from pytest_drive_robust.simulators.embedded.scenarios.junction_parts import (
    RED_S,
    end_behind_junction,
    meeting_point,
    route_flow,
)
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario
from pytest_drive_robust.simulators.embedded.signals import GREEN, red_then_green
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = ["crossing_bicycle_flow"]


@scenario(
    "CrossingBicycleFlow",
    sites=(
        Site("BikeCrossing", "E.right0", (76.0, 92.0), trigger_m=(3.0, 8.0), before_m=(32.0, 42.0)),
        Site("BikeCrossing", "N.left0", (78.0, 94.0), trigger_m=(3.0, 8.0), before_m=(32.0, 42.0)),
        Site("BikeCrossing", "S.right0", (76.0, 92.0), trigger_m=(3.0, 8.0), before_m=(32.0, 42.0)),
    ),
    parameters={"flow_speed": (8.0, 12.0)},
    intervals={"source_dist_interval": (5.0, 30.0)},
    blocked_test_off=True,
)
def crossing_bicycle_flow(stage: Stage) -> None:
    """Turn across a biking lane whose riders go straight on; the ego's light is red for five seconds first."""
    stage.lights(ego=red_then_green(RED_S), opposite=GREEN)
    route_flow(
        stage,
        _first_biking_lane(stage),
        speed_mps=(8.0, 12.0),
        gap_m=(5.0, 30.0),
        meets_ahead_m=stage.junction_ahead_m(),
        kinds=(ActorKind.BICYCLE,),
    )
    end_behind_junction(stage)


def _first_biking_lane(stage: Stage) -> int:
    """Return the path of the biking lane that the route crosses first. Raises `RouteError` when it crosses none."""
    lane_map = stage.dense.lane_map
    crossed: list[tuple[float, int]] = []
    for lane in lane_map.lanes:
        if lane.kind is not LaneKind.BIKING or not lane.junction:
            continue
        path = stage.add_path(join(lane_map, follow(lane_map, lane.index)))
        met = meeting_point(stage, path)
        if met is not None:
            crossed.append((met[0], path))
    if not crossed:
        raise RouteError(f"route {stage.dense.route.id}: scenario {stage.spec.type} needs a biking lane to turn across")
    return min(crossed)[1]
