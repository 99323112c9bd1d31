"""On motorways and country roads: get through traffic onto the road, off it, across its lanes or its junctions.

Source: Bench2Drive `scenario_runner/srunner/scenarios/actor_flow.py`. Routes go so far down an exit that an agent that
misses the exit does not come near the route's end.
"""

from __future__ import annotations

from pytest_drive_robust.arithmetic.random_numbers import Range
from pytest_drive_robust.simulators.embedded.geometry import project
from pytest_drive_robust.simulators.embedded.map import follow, join
from pytest_drive_robust.simulators.embedded.scenarios.parts import end_behind_junction, route_flow
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_ROLLING = 0.7
"""Speed of the ego at the start, as a share of the limit."""
_COUNTRY_START_MPS = 8.0
_LAST_M = 5.0
_AROUND_M = (15.0, 30.0)
"""Gaps of background traffic; Bench2Drive places its cars 15 m apart, in every lane of the road
(`scenario_runner/srunner/scenarios/background_activity.py`)."""


def _ramp(name: str, rolling: float, *, flow_mps: Range, gap_m: Range) -> None:
    """Register a type: get through the flow in the lane in which the route ends, `rolling` at that share of the limit.

    The ego leaves the motorway through a flow that stays slower than the road, merges from the acceleration lane into
    traffic that crawls at half the limit, or merges into the slow traffic of a lane that is only for the exit.
    """

    def build(stage: Stage) -> None:
        stage.start_mps = rolling * stage.speed_limit_mps
        _flow_in_last_lane(stage)

    scenario(name, flow=(flow_mps, gap_m), blocked_test_off=True)(build)


_ramp("HighwayExit", _ROLLING, flow_mps=(10.0, 15.0), gap_m=(11.0, 46.0))
_ramp("MergerIntoSlowTraffic", 0.55, flow_mps=(9.0, 10.0), gap_m=(14.0, 42.0))
_ramp("MergerIntoSlowTrafficV2", 0.55, flow_mps=(10.0, 10.0), gap_m=(11.0, 34.0))


@scenario("SequentialLaneChange", blocked_test_off=True)
def sequential_lane_change(stage: Stage) -> None:
    """Several lane changes, one after the other, through traffic that moves nearly as fast as the ego may."""
    stage.start_mps = _ROLLING * stage.speed_limit_mps
    lane_map = stage.dense.lane_map
    # behind a junction a lane begins in the middle of the town, where cars cannot appear
    used = stage.dense.lanes[: stage.dense.first_junction_row()]
    roads = dict.fromkeys(follow(lane_map, int(lane)) for lane in used)
    for number, lanes in enumerate(roads):
        path, speed_mps = stage.add_path(join(lane_map, lanes)), (0.8 + 0.05 * number) * stage.speed_limit_mps
        stage.flow(path, speed_mps=speed_mps, gap_m=_AROUND_M, background=True)
    stage.end_m = stage.dense.length_m - _LAST_M


def _country_road(name: str, *, flow_mps: Range, gap_m: Range, bearings: tuple[str, ...]) -> None:
    """Register a type: turn left on a country road, across or into the flows that come from `bearings`.

    Where roads part or meet without a junction, the only flow is that of the route file, in the lane beside the ego's.
    """

    def build(stage: Stage) -> None:
        stage.start_mps = _COUNTRY_START_MPS
        if stage.dense.first_junction_row() is None:
            _flow_in_last_lane(stage)
            return
        for bearing in bearings:
            route_flow(stage, stage.from_arm(bearing), meets_ahead_m=stage.junction_ahead_m())
        end_behind_junction(stage, metres=15.0 * len(bearings))

    scenario(name, flow=(flow_mps, gap_m), blocked_test_off=True)(build)


_country_road("InterurbanActorFlow", flow_mps=(15.0, 16.0), gap_m=(42.0, 98.0), bearings=("opposite",))
_country_road("InterurbanAdvancedActorFlow", flow_mps=(16.0, 18.0), gap_m=(36.0, 94.0), bearings=("left", "right"))


def _flow_in_last_lane(stage: Stage) -> None:
    """Put the route file's flow on the lane in which the route ends, or on the path that the file gives.

    Background traffic drives in the lane farther left, or to the right when the flow is to the left.
    """
    end = stage.dense.length_m - stage.trigger_m
    given = stage.given_flow()
    route_flow(stage, stage.own(end) if given is None else given, meets_ahead_m=end)
    level = 0.0 if stage.has_lane_beside("left") else end
    free = "left" if given is None or not _is_beside(stage, given, "left", level) else "right"
    if stage.has_lane_beside(free, level):
        speed_mps = 0.85 * stage.lane_at(level).speed_limit_mps
        stage.flow(stage.beside(free, level), speed_mps=speed_mps, gap_m=(50.0, 100.0), background=True)
    stage.end_m = stage.dense.length_m - _LAST_M


def _is_beside(stage: Stage, path: int, side: str, ahead_m: float) -> bool:
    """Return whether a path leads along the lane to the `"left"` or `"right"` of the route's."""
    width = stage.lane_at(ahead_m).width_m
    x, y = stage.spot(ahead_m, -width if side == "left" else width)
    return abs(project(stage.paths[path], x, y)[1]) < width / 2.0
