"""The route planner drops points by raw positions, tells the next two, and never goes back."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._wrappers.route_planner import MIN_SIMLINGO_M, RoutePlanner, to_ego
from pytest_drive_robust import GlobalPlan, RoadOption
from pytest_drive_robust.domain.route import PlanPoint

FOLLOW, LEFT = RoadOption.LANE_FOLLOW, RoadOption.LEFT
METRES = st.floats(-200.0, 200.0)


def plan(*points: tuple[float, float], command: RoadOption = FOLLOW) -> GlobalPlan:
    return GlobalPlan(tuple(PlanPoint(x, y, command) for x, y in points))


STRAIGHT = plan((0.0, 0.0), (20.0, 0.0), (40.0, 0.0), (60.0, 0.0))


def test_the_target_is_the_second_point_and_the_next_one_the_third() -> None:
    target = RoutePlanner(STRAIGHT).step(0.0, 0.0)
    assert (target.x_m, target.next_x_m) == (20.0, 40.0)


def test_a_point_is_dropped_within_four_metres_and_not_before() -> None:
    planner = RoutePlanner(STRAIGHT)
    assert planner.step(15.9, 0.0).x_m == 20.0
    assert planner.step(16.0, 0.0).x_m == 40.0


def test_simlingo_drops_earlier() -> None:
    assert RoutePlanner(STRAIGHT, min_m=MIN_SIMLINGO_M).step(12.6, 0.0).x_m == 40.0


def test_the_command_is_that_of_the_target() -> None:
    points = (PlanPoint(0.0, 0.0, FOLLOW), PlanPoint(20.0, 0.0, LEFT), PlanPoint(30.0, -10.0, FOLLOW))
    planner = RoutePlanner(GlobalPlan(points))
    assert planner.step(0.0, 0.0).command is LEFT
    assert planner.step(19.0, 0.0).command is FOLLOW


def test_one_wrong_position_drops_points_for_good() -> None:
    planner = RoutePlanner(STRAIGHT)
    assert planner.step(39.0, 1.0).x_m == 60.0
    assert planner.step(0.0, 0.0).x_m == 60.0


def test_of_several_points_within_reach_the_farthest_is_the_one_that_was_reached() -> None:
    near = plan((0.0, 0.0), (10.0, 0.0), (12.0, 0.0), (30.0, 0.0), (50.0, 0.0))
    assert RoutePlanner(near).step(9.0, 0.0).x_m == 30.0  # 12 is 3 m away, 10 is 1 m away
    assert RoutePlanner(near).step(12.5, 0.0).x_m == 12.0  # 10 is farther away than 12: it is the one


def test_a_point_more_than_fifty_metres_ahead_on_the_plan_is_not_looked_at() -> None:
    loop = plan((0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (0.0, 30.0), (0.0, 3.0), (-30.0, 3.0))
    assert RoutePlanner(loop).step(0.0, 0.5).x_m == 30.0


def test_the_last_point_stays_the_target() -> None:
    planner = RoutePlanner(STRAIGHT)
    for x in (20.0, 40.0, 60.0, 90.0):
        target = planner.step(x, 0.0)
    assert (target.x_m, target.next_x_m) == (60.0, 60.0)


def test_a_plan_of_one_point_leads_there() -> None:
    assert RoutePlanner(plan((5.0, 6.0))).step(0.0, 0.0)[:2] == (5.0, 6.0)


def test_a_plan_without_points_is_an_error() -> None:
    with pytest.raises(ValueError, match="no points"):
        RoutePlanner(GlobalPlan(()))


def test_a_point_to_the_south_is_to_the_right_of_who_looks_east() -> None:
    assert to_ego(0.0, 3.0, 0.0) == (0.0, 3.0)
    assert to_ego(0.0, 3.0, math.pi / 2.0) == pytest.approx((3.0, 0.0))


def test_targets_are_seen_from_the_given_pose() -> None:
    target = RoutePlanner(STRAIGHT).step(0.0, 0.0)
    first, second = target.seen_from(10.0, 5.0, 0.0)
    assert first == (10.0, -5.0)
    assert second == (30.0, -5.0)


@given(st.lists(st.tuples(METRES, METRES), min_size=1, max_size=8), st.lists(st.tuples(METRES, METRES), max_size=12))
def test_points_are_dropped_in_order_and_two_always_stay(
    points: list[tuple[float, float]], positions: list[tuple[float, float]]
) -> None:
    planner, before = RoutePlanner(plan(*points)), 0
    for x, y in positions:
        target = planner.step(x, y)
        assert before <= planner.dropped <= max(len(points) - 2, 0)
        assert target[:2] == points[min(planner.dropped + 1, len(points) - 1)]
        before = planner.dropped


@given(METRES, METRES, st.floats(-10.0, 10.0))
def test_turning_into_the_ego_frame_keeps_distances(dx: float, dy: float, yaw: float) -> None:
    forward, right = to_ego(dx, dy, yaw)
    assert math.hypot(forward, right) == pytest.approx(math.hypot(dx, dy), abs=1e-9)
