"""Routes that change lanes: their line, the lanes under it, the plan, and the road before and after."""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.route import RoadOption, Route, ScenarioSpec, TriggerPoint, Waypoint
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute, lay_route
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, project, resample
from pytest_drive_robust.simulators.embedded.map import compile_town, prolonged_chain
from pytest_drive_robust.simulators.embedded.weave import change_length_m, weave

LEFT, RIGHT = RoadOption.CHANGE_LANE_LEFT, RoadOption.CHANGE_LANE_RIGHT
CASES = {
    "on to a motorway": ("EntryRamp", "ramp.f0>road.right", -40.0, (60.0,), 170.0, (LEFT,)),
    "off a motorway": ("ExitRamp", "road.right>exit.f0", -120.0, (20.0,), 180.0, (RIGHT,)),
    "over three lanes": ("Highway", "road.f2>road.f1>road.f0", 90.0, (10.0, 80.0), 200.0, (LEFT, LEFT)),
    "to and fro": ("OneWayStreet", "road.f0>road.f1>road.f0", 85.0, (10.0, 60.0), 120.0, (RIGHT, LEFT)),
    "around a slower one": ("Avenue", "road.b1>road.b0", 90.0, (30.0,), 100.0, (LEFT,)),
}
"""Style, chains, start (negative: before the anchor), where the changes begin, length, the commands in order."""


def line_of(case: str, number: int) -> tuple[np.ndarray, list[str]]:
    style, chain, start, changes, length, _ = CASES[case]
    town = compile_town(f"{style}{number}")
    chains = chain.split(">")
    anchor = town.anchor_m(chains[0])
    begin = start if start > 0.0 else (anchor or 0.0) + start
    return weave(town, chains, start_m=begin, changes_m=list(changes), length_m=length), chains


def route_on(town: str, line: np.ndarray, *, step_m: float = 2.0) -> Route:
    fine = resample(line)
    at = np.append(np.arange(0.0, arc_lengths(fine)[-1] - 0.1, step_m), arc_lengths(fine)[-1])
    waypoints = tuple(Waypoint(*place(fine, s)[:2]) for s in at)
    return Route("9", town, waypoints, ScenarioSpec("x_1", "x", TriggerPoint(*fine[5, :2], 0.0, 0.0)))


def laid(case: str, number: int) -> DenseRoute:
    return lay_route(route_on(f"{CASES[case][0]}{number}", line_of(case, number)[0]))


ANY_CASE = pytest.mark.parametrize("case", sorted(CASES))
SOME = settings(max_examples=12, deadline=None)
NUMBERS = st.integers(0, 999_999)


@ANY_CASE
@given(number=NUMBERS)
@SOME
def test_the_lanes_under_the_route_are_those_of_its_chains_in_order(case: str, number: int) -> None:
    dense = laid(case, number)
    town, chains = compile_town(dense.route.town), CASES[case][1].split(">")
    step = 0
    for lane in dense.lanes:
        while lane not in town.chains[chains[step]]:
            step += 1
    assert step == len(chains) - 1
    assert dense.length_m == pytest.approx(CASES[case][4], abs=1.5)


@ANY_CASE
@given(number=NUMBERS)
@SOME
def test_the_plan_says_where_each_change_begins_and_ends(case: str, number: int) -> None:
    dense = laid(case, number)
    begins, commands = CASES[case][3], CASES[case][5]
    points = dense.plan().points
    changing = [k for k, point in enumerate(points) if point.command in (LEFT, RIGHT)]
    starts = [k for k in changing if points[k - 1].command is not points[k].command]
    assert tuple(points[k].command for k in starts) == commands
    limit = max(lane.speed_limit_mps for lane in dense.lane_map.lanes if lane.kind is LaneKind.DRIVING)
    for k, begin in zip(starts, begins, strict=True):
        at = project(dense.rows, points[k].x_m, points[k].y_m)[0]
        over = next(point for point in points[k:] if point.command is RoadOption.LANE_FOLLOW)
        end = project(dense.rows, over.x_m, over.y_m)[0]
        assert begin <= at < begin + 8.0
        assert begin + change_length_m(limit) - 8.0 < end <= begin + change_length_m(limit) + 2.0
    gaps = [np.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(points)]
    assert max(gaps) <= 51.0


@ANY_CASE
@given(number=NUMBERS)
@SOME
def test_a_change_is_smooth_enough_for_the_speed_limit(case: str, number: int) -> None:
    dense = laid(case, number)
    turn = np.abs(np.diff(np.unwrap(dense.rows[:, 2]))) / np.diff(dense.s)
    assert (turn[2:-2] * dense.rows[2:-3, 3] ** 2).max() < 5.5  # m/s2: the change and the bend of the road together


@ANY_CASE
@given(number=NUMBERS)
@SOME
def test_the_driven_line_is_the_route_with_road_before_and_after(case: str, number: int) -> None:
    dense = laid(case, number)
    line, start = dense.driven_line()
    assert start > 40.0
    total = float(arc_lengths(line)[-1])
    assert total > start + dense.length_m + 40.0
    for row, s in zip(dense.rows[::7], dense.s[::7], strict=True):
        along, aside = project(line, row[0], row[1])
        assert abs(aside) < 0.05
        assert along - start == pytest.approx(s, abs=0.3)
    assert np.hypot(np.diff(line[:, 0]), np.diff(line[:, 1])).max() < 1.05
    assert np.abs(np.diff(line[:, 2])).max() < 0.1
    lanes = dense.lane_map.lanes
    used = tuple(lane for lane, _ in groupby(dense.lanes.tolist()))
    chain = prolonged_chain(dense.lane_map, used)
    assert used == tuple(lane for lane in chain if lane in used)
    assert not lanes[chain[-1]].successors
    assert not any(chain[0] in lane.successors for lane in lanes)


def test_a_lane_change_is_refused_where_it_does_not_fit() -> None:
    town = compile_town("EntryRamp3")
    anchor = town.anchor_m("ramp.f0")
    assert anchor is not None
    chains = ["ramp.f0", "road.right"]
    with pytest.raises(RouteError, match=r"'ramp\.f0' and 'road\.right' do not lie side by side"):
        weave(town, chains, start_m=anchor - 90.0, changes_m=[5.0], length_m=150.0)
    with pytest.raises(RouteError, match=r"'ramp\.f0' ends before the route has changed to 'road\.right'"):
        weave(town, chains, start_m=anchor, changes_m=[110.0], length_m=200.0)
    with pytest.raises(RouteError, match="begins before the one before it ends"):
        weave(compile_town("Highway1"), ["road.f0", "road.f1", "road.f2"], start_m=90.0, changes_m=[5.0, 20.0],
              length_m=150.0)  # fmt: skip
    with pytest.raises(RouteError, match="does not fit a route of 600 m"):
        weave(town, ["road.f0"], start_m=90.0, changes_m=[], length_m=600.0)


def test_a_route_may_lie_beside_the_middle_of_its_lane_but_not_off_the_road_or_against_the_traffic() -> None:
    town = compile_town("Avenue6")
    line = town.chain("road.f1")[90:190]
    width = town.lane_map.lanes[town.chains["road.f1"][0]].width_m
    right = np.column_stack([-np.sin(line[:, 2]), np.cos(line[:, 2])])
    dense = lay_route(route_on("Avenue6", line[:, :2] + 1.6 * right))
    assert set(dense.lanes.tolist()) <= set(town.chains["road.f1"])
    with pytest.raises(RouteError, match="from the nearest lane of town 'Avenue6'"):
        lay_route(route_on("Avenue6", line[:, :2] + (width / 2.0 + 0.7) * right))
    with pytest.raises(RouteError, match="a lane that leads the route's way"):
        lay_route(route_on("Avenue6", line[::-1, :2]))


@pytest.mark.parametrize("length_m", [0.0, 0.5, 19.0])
def test_a_route_too_short_to_be_driven_is_refused(length_m: float) -> None:
    start = compile_town("Street1").chain("road.f0")[20]
    ends = tuple(Waypoint(float(start[0]) + s, float(start[1])) for s in (0.0, length_m))
    route = Route("9", "Street1", ends, ScenarioSpec("x_1", "x", TriggerPoint(*start[:2], 0.0, 0.0)))
    with pytest.raises(RouteError, match=rf"route 9: its waypoints are {length_m:g} m long, expected 20 to 20000 m"):
        lay_route(route)


@pytest.mark.parametrize(
    ("name", "chain", "commands", "stops"),
    [
        ("Grid4", "W0.straight-left0", [RoadOption.STRAIGHT, RoadOption.LEFT], 4),
        ("Roundabout2", "S.left0", [RoadOption.LEFT], 0),
        ("Roundabout2", "S.straight0", [RoadOption.STRAIGHT], 0),
        ("Roundabout2", "S.right0", [RoadOption.RIGHT], 0),
        ("LightTee2", "S.left0", [RoadOption.LEFT], 3),
        ("StopTee2", "W.right0", [RoadOption.RIGHT], 1),
        ("RuralCrossing9", "N.straight0", [RoadOption.STRAIGHT], 2),
    ],
)
def test_a_route_knows_its_junctions(name: str, chain: str, commands: list[RoadOption], stops: int) -> None:
    town = compile_town(name)
    line = town.chain(chain)
    anchor = town.anchor_m(chain)
    assert anchor is not None
    dense = lay_route(route_on(name, line[int(anchor) - 30 : -70]))
    driven = [command for command, _ in groupby(point.command for point in dense.plan().points)]
    assert [command for command in driven if command is not RoadOption.LANE_FOLLOW] == commands
    assert len(dense.passages()) == len(commands)
    first = dense.first_passage()
    assert first is not None
    assert first.enters == dense.lanes[0]
    assert len(dense.junction_stops()) == stops
    for k, way in enumerate(dense.passages()):
        entries = {other.enters for other in town.passages if other.junction == way.junction}
        assert {dense.lane_map.stop_lines[s].lane for s in dense.junction_stops(k)} <= entries
