"""On motorways: get through slow or dense traffic onto the road, off it, or across its lanes.

Source: Bench2Drive `scenario_runner/srunner/scenarios/actor_flow.py`. Routes go so far down an exit that whoever
misses it does not come near their end.
"""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded.geometry import project
from pytest_drive_robust.simulators.embedded.map import follow, join
from pytest_drive_robust.simulators.embedded.scenarios.junction_parts import route_end_ahead_m, route_flow
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = [
    "flow_in_last_lane",
    "highway_exit",
    "merger_into_slow_traffic",
    "merger_into_slow_traffic_v2",
    "sequential_lane_change",
]

_RAMP_ROLLING, _ROLLING = 0.55, 0.7
"""Speeds at the start, as shares of the limit."""
_LAST_M = 5.0
_AROUND_M = (15.0, 30.0)
"""Bench2Drive's background traffic is placed 15 m apart, in every lane of the road
(`scenario_runner/srunner/scenarios/background_activity.py`)."""


def _before_a_turn(chain: str) -> Site:
    """Return a site with two lane changes on an avenue, then a turn from the lane for it."""
    return Site(
        "LightAvenueCrossing", chain, (128.0, 145.0), before_m=(90.0, 96.0), changes_m=((6.0, 10.0), (46.0, 50.0))
    )


@scenario(
    "HighwayExit",
    sites=(
        Site("ExitRamp", "road.right>exit.f0", (154.0, 164.0), before_m=(78.0, 86.0), changes_m=((10.0, 18.0),)),
        Site("ExitRamp", "road.right>exit.f0", (162.0, 172.0), before_m=(86.0, 94.0), changes_m=((14.0, 26.0),)),
    ),
    parameters={"flow_speed": (10.0, 15.0)},
    intervals={"source_dist_interval": (11.0, 46.0)},
    blocked_test_off=True,
)
def highway_exit(stage: Stage) -> None:
    """Leave the motorway through a flow in the exit lane that stays slower than the road."""
    stage.start_mps = _ROLLING * stage.speed_limit_mps
    flow_in_last_lane(stage, speed_mps=(10.0, 15.0), gap_m=(11.0, 46.0))


@scenario(
    "MergerIntoSlowTraffic",
    sites=(
        Site("EntryRamp", "ramp.f0>road.right", (158.0, 180.0), before_m=(55.0, 65.0), changes_m=((70.0, 80.0),)),
        Site("EntryRamp", "ramp.f0>road.right", (158.0, 180.0), before_m=(65.0, 75.0), changes_m=((80.0, 90.0),)),
    ),
    parameters={"flow_speed": (9.0, 10.0)},
    intervals={"source_dist_interval": (14.0, 42.0)},
    blocked_test_off=True,
)
def merger_into_slow_traffic(stage: Stage) -> None:
    """Merge from the acceleration lane into traffic that crawls at half the limit."""
    stage.start_mps = _RAMP_ROLLING * stage.speed_limit_mps
    flow_in_last_lane(stage, speed_mps=(9.0, 10.0), gap_m=(14.0, 42.0))


@scenario(
    "MergerIntoSlowTrafficV2",
    sites=(
        Site("ExitRamp", "road.right>exit.f0", (156.0, 166.0), before_m=(80.0, 88.0), changes_m=((12.0, 20.0),)),
        Site("ExitRamp", "road.right>exit.f0", (164.0, 174.0), before_m=(88.0, 96.0), changes_m=((16.0, 28.0),)),
    ),
    parameters={"flow_speed": (10.0, 10.0)},
    intervals={"source_dist_interval": (11.0, 34.0)},
    blocked_test_off=True,
)
def merger_into_slow_traffic_v2(stage: Stage) -> None:
    """Merge into the slow traffic of a lane that is only for the exit."""
    stage.start_mps = _RAMP_ROLLING * stage.speed_limit_mps
    flow_in_last_lane(stage, speed_mps=(10.0, 10.0), gap_m=(11.0, 34.0))


@scenario(
    "SequentialLaneChange",
    sites=(
        Site("Highway", "road.f0>road.f1>road.f2", (150.0, 170.0), changes_m=((10.0, 16.0), (74.0, 84.0))),
        _before_a_turn("E.straight0>E.straight1>E.left0"),
        Site(
            "ExitRamp",
            "road.f0>road.f1>exit.f0",
            (217.0, 221.9),
            before_m=(136.0, 142.0),
            changes_m=((4.0, 8.0), (68.0, 74.0)),
        ),
        _before_a_turn("W.straight1>W.straight0>W.right1"),
        Site("Highway", "road.f2>road.f1>road.f0", (150.0, 170.0), changes_m=((10.0, 16.0), (74.0, 84.0))),
    ),
    blocked_test_off=True,
)
def sequential_lane_change(stage: Stage) -> None:
    """Several lane changes, one after the other, through traffic that moves nearly as fast as the ego may."""
    stage.start_mps = _ROLLING * stage.speed_limit_mps
    lane_map = stage.dense.lane_map
    # behind a junction a lane begins in the middle of the town: no place for a source
    used = stage.dense.lanes[: stage.dense.first_junction_row()]
    roads = dict.fromkeys(follow(lane_map, int(lane)) for lane in used)
    for number, lanes in enumerate(roads):
        stage.flow(
            stage.add_path(join(lane_map, lanes)),
            speed_mps=(0.8 + 0.05 * number) * stage.speed_limit_mps,
            gap_m=_AROUND_M,
            background=True,
        )
    stage.end_m = stage.dense.length_m - _LAST_M


def flow_in_last_lane(stage: Stage, *, speed_mps: tuple[float, float], gap_m: tuple[float, float]) -> None:
    """Put the flow of the route file on the lane in which the route ends, or from where to where the file says.

    There is background traffic farther left, or to the right where the flow is to the left.
    """
    end = route_end_ahead_m(stage)
    given = stage.given_flow()
    route_flow(stage, stage.own(end) if given is None else given, speed_mps=speed_mps, gap_m=gap_m, meets_ahead_m=end)
    level = 0.0 if stage.has_lane_beside("left") else end
    free = "left" if given is None or not _is_beside(stage, given, "left", level) else "right"
    if stage.has_lane_beside(free, level):
        stage.flow(
            stage.beside(free, level), speed_mps=0.85 * stage.lane_at(level).speed_limit_mps, gap_m=(50.0, 100.0),
            background=True,
        )  # fmt: skip
    stage.end_m = stage.dense.length_m - _LAST_M


def _is_beside(stage: Stage, path: int, side: str, ahead_m: float) -> bool:
    """Return whether a path leads along the lane to the `"left"` or `"right"` of the route's."""
    width = stage.lane_at(ahead_m).width_m
    x, y = stage.spot(ahead_m, -width if side == "left" else width)
    return abs(project(stage.paths[path], x, y)[1]) < width / 2.0
