"""Windowed PIDs and the controller of waypoints: rest is safe, caps hold, the target takes over where it should."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._wrappers import tuning
from drive_robust_agents._wrappers.pid import (
    Gains,
    Point,
    WaypointController,
    WaypointTuning,
    WindowedPid,
    capped_throttle,
    published_turn_of,
    turn_of,
)
from pytest_drive_robust import Control

AHEAD: Point = (30.0, 0.0)
ERRORS = st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=60)
AGENTS = pytest.mark.parametrize("agent", [tuning.TCP, tuning.UNIAD, tuning.VAD], ids=["tcp", "uniad", "vad"])


def driving(speed_mps: float, *, bend: float = 0.0, count: int = 4) -> list[Point]:
    """Waypoints of a constant speed, on a line that bends by so many radians from one to the next."""
    points, x, y = [], 0.0, 0.0
    for k in range(count):
        turned = (k + 0.5) * bend
        x, y = x + 0.5 * speed_mps * math.cos(turned), y + 0.5 * speed_mps * math.sin(turned)
        points.append((x, y))
    return points


def step(given: WaypointTuning, waypoints: list[Point], speed_mps: float, target: Point = AHEAD) -> Control:
    return WaypointController(given).step(waypoints, speed_mps, target)


@given(ERRORS)
def test_the_integral_is_the_mean_of_the_window_that_began_with_zeros(errors: list[float]) -> None:
    pid = WindowedPid(Gains(0.0, 1.0, 0.0, 40))
    for error in errors:
        told = pid.step(error)
    assert told == pytest.approx(sum(errors[-40:]) / 40.0)


@given(ERRORS)
def test_the_derivative_is_the_last_difference(errors: list[float]) -> None:
    pid = WindowedPid(Gains(0.0, 0.0, 1.0, 5))
    told = [pid.step(error) for error in errors]
    assert told == [b - a for a, b in zip([0.0, *errors], errors, strict=False)]


def test_an_error_is_forgotten_once_it_left_the_window() -> None:
    pid = WindowedPid(Gains(1.0, 1.0, 1.0, 3))
    told = [pid.step(error) for error in (6.0, 0.0, 0.0, 0.0)]
    assert told[-2:] == [2.0, 0.0]


@AGENTS
def test_at_rest_with_nothing_wanted_it_stands(agent: WaypointTuning) -> None:
    pedals = step(agent, [(0.0, 0.0)] * 4, 0.0)
    assert (pedals.throttle, pedals.brake) == (0.0, 1.0)


@AGENTS
@given(
    st.lists(st.tuples(st.floats(-90.0, 90.0), st.floats(-90.0, 90.0)), min_size=2, max_size=6),
    st.floats(0.0, 40.0),
    st.tuples(st.floats(-90.0, 90.0), st.floats(-90.0, 90.0)),
)
def test_whatever_the_network_says_the_pedals_are_within_their_ranges(
    agent: WaypointTuning, waypoints: list[Point], speed_mps: float, target: Point
) -> None:
    pedals = step(agent, waypoints, speed_mps, target)
    assert 0.0 <= pedals.throttle <= agent.most_throttle
    assert -1.0 <= pedals.steer <= 1.0
    assert pedals.brake in (0.0, 1.0)
    assert pedals.throttle * pedals.brake == 0.0


@AGENTS
def test_it_brakes_when_too_fast_and_accelerates_when_too_slow(agent: WaypointTuning) -> None:
    assert step(agent, driving(4.0), 6.0).brake == 1.0
    assert step(agent, driving(4.0), 2.0).throttle > 0.0
    assert step(agent, driving(4.0), 4.2) == Control(0.0, 0.0, 0.0)


def test_the_wanted_speed_is_that_of_the_first_pairs_of_waypoints() -> None:
    speeding_up = [(1.0, 0.0), (2.0, 0.0), (4.0, 0.0), (9.0, 0.0)]
    for pairs, wanted_mps in ((2, 3.0), (3, 16.0 / 3.0)):
        tuned = replace(tuning.VAD, speed_pairs=pairs)
        fastest_mps = tuned.brake_ratio * wanted_mps
        assert step(tuned, speeding_up, fastest_mps - 1e-6).brake == 0.0
        assert step(tuned, speeding_up, fastest_mps + 1e-6).brake == 1.0


@AGENTS
def test_it_steers_to_the_side_to_which_the_waypoints_bend(agent: WaypointTuning) -> None:
    bent = driving(6.0, bend=0.3)
    assert step(agent, bent, 6.0, target=(12.0, 12.0)).steer > 0.1
    assert step(agent, [(x, -y) for x, y in bent], 6.0, target=(12.0, -12.0)).steer < -0.1


def test_a_far_target_does_not_keep_the_agent_from_going_around_something() -> None:
    assert step(tuning.VAD, driving(6.0, bend=0.3), 6.0).steer > 0.1
    assert abs(step(tuning.PUBLISHED, driving(6.0, bend=0.3), 6.0).steer) < 0.01


@given(st.floats(-3.0, 3.0), st.floats(0.6, 50.0))
def test_published_directions_are_ours_but_behind_on_the_left(angle: float, away_m: float) -> None:
    point = (away_m * math.cos(angle), away_m * math.sin(angle))
    behind_on_the_left = turn_of(point) < -1.0
    expected = turn_of(point) + (4.0 if behind_on_the_left else 0.0)
    assert published_turn_of(point) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("agent", [tuning.TCP_PUBLISHED, tuning.UNIAD_PUBLISHED, tuning.VAD_PUBLISHED])
def test_published_agents_turn_right_for_every_target_behind_them(agent: WaypointTuning) -> None:
    for side in (-2.0, 2.0):
        assert step(agent, driving(4.0), 4.0, target=(-5.0, side)).steer == 1.0
    assert step(tuning.VAD, driving(4.0), 4.0, target=(-5.0, -2.0)).steer == -1.0


def test_a_near_target_that_lies_straighter_ahead_is_preferred() -> None:
    assert step(tuning.VAD, driving(6.0, bend=0.3), 6.0, target=(7.0, 0.0)).steer == 0.0


def test_a_near_target_that_disagrees_with_the_end_of_the_plan_overrules_it() -> None:
    assert step(tuning.VAD, driving(6.0), 6.0, target=(1.0, 7.0)).steer == 1.0


def test_an_aim_at_its_own_wheels_steers_nowhere() -> None:
    assert turn_of((0.1, 0.4)) == 0.0
    assert turn_of((0.0, 0.6)) == 1.0


def test_tcp_is_capped_above_walking_pace_by_the_speed_that_it_is_told() -> None:
    fast = driving(12.0)
    assert step(tuning.TCP, fast, 1.0).throttle == tuning.TCP.free_throttle
    assert step(tuning.TCP, fast, 8.0).throttle == tuning.TCP.cruise_throttle
    assert step(tuning.TCP, fast, 0.15 * 8.0).throttle == tuning.TCP.free_throttle  # it drives 8 m/s


def test_tcp_is_capped_earlier_where_it_steers() -> None:
    assert capped_throttle(tuning.TCP, 1.2, 0.0) == tuning.TCP.free_throttle
    assert capped_throttle(tuning.TCP, 1.2, -0.2) == tuning.TCP.cruise_throttle


def test_uniad_coasts_at_speed_and_vad_does_not() -> None:
    above = tuning.UNIAD.coast_above_mps + 0.1
    assert step(tuning.UNIAD, driving(above + 5.0), above).throttle == 0.0
    assert step(tuning.VAD, driving(above + 5.0), above).throttle == tuning.VAD.most_throttle


def test_the_published_numbers_are_those_of_the_released_agents() -> None:
    for published in (tuning.TCP_PUBLISHED, tuning.UNIAD_PUBLISHED, tuning.VAD_PUBLISHED):
        assert (published.turn, published.speed) == (Gains(0.75, 0.75, 0.3, 40), Gains(5.0, 0.5, 1.0, 40))
        assert (published.aim_m, published.target_turn, published.target_within_m) == (4.0, 0.3, 10.0)
        assert (published.brake_below_mps, published.brake_ratio) == (0.4, 1.1)
        assert (published.most_missing_mps, published.most_throttle) == (0.25, 0.75)
        assert step(published, driving(4.0, bend=0.1), 4.0, target=(60.0, 0.0)).steer == 0.0  # wherever the target lies
    assert [capped_throttle(tuning.TCP_PUBLISHED, speed, steer) for speed, steer in ((1.6, 0.0), (1.2, 0.08))] == [
        0.05
    ] * 2
    assert step(tuning.UNIAD_PUBLISHED, driving(9.0), 5.1).throttle == 0.0
