"""Every style of town, for any number: what roads, junctions, houses and signals must be like."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.truth import Lane, LaneKind
from pytest_drive_robust.errors import RouteError, UnknownNameError
from pytest_drive_robust.simulators.embedded.map import CompiledTown, compile_town, follow
from pytest_drive_robust.simulators.embedded.towns import STYLES, build_town

NUMBERS = st.integers(0, 999_999)
TOWNS = st.builds(lambda style, number: f"{style}{number}", st.sampled_from(sorted(STYLES)), NUMBERS)
SOME = settings(max_examples=40, deadline=None)

PASSAGES = {
    "LightCrossing": 12, "LightAvenueCrossing": 16, "StopCrossing": 12, "OpenCrossing": 12, "RuralCrossing": 12,
    "BikeCrossing": 12, "LightTee": 6, "StopTee": 6, "OpenTee": 6, "RuralTee": 6, "Roundabout": 16, "Grid": 48,
}  # fmt: skip
"""Ways of cars through all junctions; in a roundabout one may also turn round."""
STOPS = {
    "LightCrossing": 4, "LightAvenueCrossing": 8, "StopCrossing": 4, "RuralCrossing": 2, "BikeCrossing": 4,
    "LightTee": 3, "StopTee": 1, "Grid": 16,
}  # fmt: skip


def each_style(test: object) -> object:
    """The named property for one town of every style, and for any other town."""
    for style in STYLES:
        test = example(f"{style}17")(test)  # type: ignore[arg-type,assignment]
    return SOME(given(TOWNS)(test))  # type: ignore[arg-type]


def apart_rad(angle: float, other: float) -> float:
    return abs(math.remainder(angle - other, math.tau))


def edges(lane: Lane) -> np.ndarray:
    """Points on both edges and the middle of a lane, (m, 2)."""
    normal = np.column_stack([-np.sin(lane.centre[:, 2]), np.cos(lane.centre[:, 2])])
    return np.concatenate([lane.centre[:, :2] + side * lane.width_m / 2.0 * normal for side in (-1.0, 0.0, 1.0)])


@each_style
def test_lanes_that_follow_each_other_join_smoothly(name: str) -> None:
    lanes = compile_town(name).lane_map.lanes
    for lane in lanes:
        for after in lane.successors:
            end, start = lane.centre[-1], lanes[after].centre[0]
            assert np.hypot(*(end[:2] - start[:2])) < 0.01
            assert apart_rad(end[2], start[2]) < 0.01
            assert lanes[after].kind is lane.kind
            assert lanes[after].width_m == pytest.approx(lane.width_m)


@each_style
def test_neighbours_know_each_other_and_touch(name: str) -> None:
    lanes = compile_town(name).lane_map.lanes
    for lane in lanes:
        for index, same_way, right in ((lane.left, lane.left_same_way, -1.0), (lane.right, lane.right_same_way, 1.0)):
            if index < 0:
                continue
            other = lanes[index]
            # the right neighbour of a lane has it on its left, one that comes the other way has it on its own side
            back = (other.left, other.left_same_way) if (right > 0) == same_way else (other.right, other.right_same_way)
            assert back == (lane.index, same_way)
            x, y, heading = lane.centre[len(lane.centre) // 2]
            away = np.hypot(other.centre[:, 0] - x, other.centre[:, 1] - y)
            near = other.centre[np.argmin(away)]
            beside = -(near[0] - x) * np.sin(heading) + (near[1] - y) * np.cos(heading)
            assert beside * right == pytest.approx((lane.width_m + other.width_m) / 2.0, abs=0.05)
            assert (np.cos(near[2] - heading) > 0.0) == same_way


@each_style
def test_no_house_stands_on_a_lane(name: str) -> None:
    town = compile_town(name).lane_map
    points = np.concatenate([edges(lane) for lane in town.lanes])
    assert len(town.buildings) > 5
    for x, y, yaw, length, width, _ in town.buildings:
        dx, dy = points[:, 0] - x, points[:, 1] - y
        along, across = dx * np.cos(yaw) + dy * np.sin(yaw), -dx * np.sin(yaw) + dy * np.cos(yaw)
        assert not ((np.abs(along) < length / 2.0 + 0.3) & (np.abs(across) < width / 2.0 + 0.3)).any()


@each_style
def test_every_chain_can_be_driven_from_end_to_end(name: str) -> None:
    town = compile_town(name)
    lanes = town.lane_map.lanes
    for chain in town.chains.values():
        assert all(after in lanes[before].successors for before, after in pairwise(chain))
        if lanes[chain[0]].kind is LaneKind.DRIVING:
            for k in chain:
                steps = np.hypot(np.diff(lanes[k].centre[:, 0]), np.diff(lanes[k].centre[:, 1]))
                assert (np.abs(np.diff(lanes[k].centre[:, 2])) < steps * 1.02 / 6.0 + 1e-9).all()


@each_style
def test_stop_lines_lie_across_their_lanes_and_no_pole_stands_on_one(name: str) -> None:
    town = compile_town(name).lane_map
    driving = [lane for lane in town.lanes if lane.kind is not LaneKind.SIDEWALK]
    points = np.concatenate([lane.centre[:, :2] for lane in driving])
    halves = np.concatenate([np.full(len(lane.centre), lane.width_m / 2.0) for lane in driving])
    for line in town.stop_lines:
        lane = town.lanes[line.lane]
        away = np.hypot(lane.centre[:, 0] - line.x_m, lane.centre[:, 1] - line.y_m)
        assert away.min() < 0.55
        assert apart_rad(lane.centre[int(away.argmin()), 2], line.heading_rad) < 0.01
        assert any(town.lanes[after].junction for after in lane.successors)
        dx, dy = line.pole_x_m - line.x_m, line.pole_y_m - line.y_m
        ahead = dx * np.cos(line.heading_rad) + dy * np.sin(line.heading_rad)
        assert (10.0 if line.is_light else 0.0) < ahead < 60.0
        assert -dx * np.sin(line.heading_rad) + dy * np.cos(line.heading_rad) > lane.width_m / 2.0
        assert (np.hypot(points[:, 0] - line.pole_x_m, points[:, 1] - line.pole_y_m) > halves + 0.3).all()


@each_style
def test_roads_do_not_lie_on_each_other(name: str) -> None:
    lanes = [lane for lane in compile_town(name).lane_map.lanes if not lane.junction]
    for one, other in combinations(lanes, 2):
        if other.index in one.successors or one.index in other.successors:
            continue
        mine, theirs = one.centre[::6, :2], other.centre[::6, :2]
        away = np.hypot(mine[:, None, 0] - theirs[None, :, 0], mine[:, None, 1] - theirs[None, :, 1])
        assert away.min() > (one.width_m + other.width_m) / 2.0 - 0.05


@pytest.mark.parametrize("style", sorted(STYLES))
def test_junctions_have_all_their_ways_and_signals(style: str) -> None:
    town = compile_town(f"{style}5")
    assert len(town.passages) == PASSAGES.get(style, 0)
    assert len(town.lane_map.stop_lines) == STOPS.get(style, 0)
    assert all(line.is_light == ("Stop" not in style and "Rural" not in style) for line in town.lane_map.stop_lines)
    for way in town.passages:
        assert all(town.lane_map.lanes[k].junction for k in way.inside)
        assert not town.lane_map.lanes[way.enters].junction
        assert not town.lane_map.lanes[way.leaves].junction
        assert {town.junctions[k] for k in way.inside} == {way.junction}


@pytest.mark.parametrize("style", sorted(style for style in PASSAGES if style != "Grid"))
def test_chains_turn_where_their_names_say(style: str) -> None:
    town = compile_town(f"{style}8")
    wanted = {"left": -90.0, "straight": 0.0, "right": 90.0}
    for name, chain in town.chains.items():
        turn = name.split(".")[1].rstrip("0123456789")
        if turn in wanted:
            inside = [k for k in chain if town.lane_map.lanes[k].junction]
            ways = [way for way in town.passages if list(way.inside) == inside]
            assert len(ways) == 1
            assert math.degrees(ways[0].turn_rad) == pytest.approx(wanted[turn], abs=0.01)


def headings_deg(town: CompiledTown, chain: str) -> list[int]:
    """The quarters in which a chain leads, one for each stretch of straight road."""
    lanes = [town.lane_map.lanes[k] for k in town.lanes_of(chain)]
    return [round(math.degrees(lane.centre[0, 2])) % 360 for lane in lanes if not lane.junction]


@given(NUMBERS)
@settings(max_examples=10, deadline=None)
def test_a_grid_has_routes_over_one_two_and_three_crossings(number: int) -> None:
    town = compile_town(f"Grid{number}")
    assert headings_deg(town, "W0.straight0") == [0, 0, 0]
    assert headings_deg(town, "W0.left0") == [0, 270]
    assert headings_deg(town, "W0.straight-right0") == [0, 0, 90, 90]
    assert headings_deg(town, "S1.left-right0") == [270, 180, 270, 270]
    for name in town.chains:
        if name.split(".")[1][0] in "lsr":
            lanes = town.lane_map.lanes
            assert not lanes[town.chains[name][-1]].successors, f"{name} ends inside the town"


def test_straight_on_through_a_roundabout_is_the_exit_opposite() -> None:
    town = compile_town("Roundabout4")
    for arm in "ESWN":
        assert follow(town.lane_map, town.chains[f"{arm}.b0"][0]) == town.chains[f"{arm}.straight0"]


@given(number=NUMBERS)
@SOME
def test_ramps_touch_the_road_where_the_anchor_says(number: int) -> None:
    entry, leave = compile_town(f"EntryRamp{number}"), compile_town(f"ExitRamp{number}")
    lanes = entry.lane_map.lanes
    acceleration = lanes[entry.chains["ramp.f0"][-1]]
    assert acceleration.left_same_way
    assert acceleration.left in entry.chains["road.right"]
    assert (acceleration.left_line, acceleration.right_line) == ("striped", "solid")
    assert not acceleration.successors
    assert 90.0 <= len(acceleration.centre) - 1 <= 140.0
    off = leave.lane_map.lanes[leave.chains["exit.f0"][0]]
    assert off.left in leave.chains["road.right"]
    for town, chain, lane in ((entry, "ramp.f0", acceleration.centre[0]), (leave, "exit.f0", off.centre[-1])):
        anchor = town.anchor_m(chain)
        assert anchor is not None
        line = town.chain(chain)
        assert np.hypot(*(line[round(anchor), :2] - lane[:2])) < 1.5


@given(style=st.sampled_from(sorted(STYLES)), number=NUMBERS, other=NUMBERS)
@SOME
def test_towns_of_different_numbers_differ_and_of_equal_numbers_do_not(style: str, number: int, other: int) -> None:
    def shape(town: CompiledTown) -> bytes:
        lanes = town.lane_map.lanes
        return b"".join(lane.centre.tobytes() + repr(lane.width_m).encode() for lane in lanes)

    first = shape(compile_town(f"{style}{number}"))
    assert first == shape(CompiledTown(build_town(f"{style}{number}")))
    assert (first == shape(compile_town(f"{style}{other}"))) == (number == other)


def test_sidewalks_biking_lanes_and_parking_lie_outside_the_traffic() -> None:
    order = [LaneKind.DRIVING, LaneKind.BIKING, LaneKind.PARKING, LaneKind.SIDEWALK]
    for style in STYLES:
        lanes = compile_town(f"{style}2").lane_map.lanes
        for lane in lanes:
            if lane.right >= 0:
                assert order.index(lanes[lane.right].kind) >= order.index(lane.kind)


@pytest.mark.parametrize("name", ["Street", "Street-1", "Street1234567", "7", ""])
def test_a_town_without_a_proper_number_is_refused(name: str) -> None:
    with pytest.raises(RouteError, match="expected a style and a number such as 'Street1'"):
        build_town(name)


def test_an_unknown_style_or_chain_comes_with_the_nearest_one() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'Roundabout'"):
        build_town("Roundabuot3")
    with pytest.raises(UnknownNameError, match=r"Did you mean 'road\.f0'"):
        compile_town("Street1").chain("road.f00")
