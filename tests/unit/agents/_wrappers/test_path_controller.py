"""SimLingo's controllers: the path steers, the speed waypoints drive; creeping after a long stop."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._wrappers import tuning
from drive_robust_agents._wrappers.path_controller import Creep, PathController, along
from drive_robust_agents._wrappers.pid import Point
from pytest_drive_robust import Control

STRAIGHT = [(float(k), 0.0) for k in range(1, 21)]
TO_THE_RIGHT = [(9.0 * math.sin(k / 9.0), 9.0 * (1.0 - math.cos(k / 9.0))) for k in range(1, 21)]


def at(speed_mps: float) -> list[Point]:
    return [(0.25 * speed_mps * k, 0.0) for k in range(1, 11)]


def step(path: list[Point], wanted_mps: float, speed_mps: float) -> Control:
    return PathController(tuning.SIMLINGO).step(path, at(wanted_mps), speed_mps)


def test_at_rest_with_nothing_wanted_it_stands() -> None:
    assert step([(0.0, 0.0)] * 20, 0.0, 0.0) == Control(0.0, 0.0, 1.0)


def test_the_wanted_speed_is_that_of_the_waypoints() -> None:
    fastest_mps = tuning.SIMLINGO.brake_ratio * 7.0
    assert step(STRAIGHT, 7.0, fastest_mps - 1e-6).brake == 0.0
    assert step(STRAIGHT, 7.0, fastest_mps + 1e-6).brake == 1.0


def test_it_accelerates_brakes_and_coasts() -> None:
    assert step(STRAIGHT, 7.0, 5.0).throttle == 1.0
    assert step(STRAIGHT, 5.0, 7.0).brake == 1.0
    assert step(STRAIGHT, 5.0, 5.2) == Control(0.0, 0.0, 0.0)


def test_it_brakes_at_once_for_a_plan_that_slows_down_within_two_seconds() -> None:
    slowing = [(8.0 * t - 1.5 * t * t, 0.0) for t in (0.25 * k for k in range(1, 11))]
    assert PathController(tuning.SIMLINGO).step(STRAIGHT, slowing, 8.0).brake == 1.0
    published = replace(tuning.SIMLINGO, speed_from=0, speed_to=2)
    assert PathController(published).step(STRAIGHT, slowing, 6.8).brake == 0.0
    assert PathController(tuning.SIMLINGO).step(STRAIGHT, slowing, 6.8).brake == 1.0


@pytest.mark.parametrize("speed_mps", [0.0, 3.0, 8.0])
def test_it_steers_along_the_path_whatever_the_speed_waypoints_say(speed_mps: float) -> None:
    assert step(STRAIGHT, 0.0, speed_mps).steer == 0.0
    assert step(TO_THE_RIGHT, 0.0, speed_mps).steer > 0.3
    assert step([(x, -y) for x, y in TO_THE_RIGHT], 9.0, speed_mps).steer < -0.3


def test_it_looks_farther_ahead_when_it_drives_faster() -> None:
    late = [(float(k), 0.0 if k < 5 else float(k - 4)) for k in range(1, 21)]
    assert step(late, 5.0, 2.0).steer == 0.0
    assert step(late, 5.0, 15.0).steer > 0.1


@given(st.floats(0.01, 30.0))
def test_a_place_along_a_path_is_so_far_away_along_it(distance_m: float) -> None:
    bent: list[Point] = [(4.0, 0.0), (4.0, 3.0), (10.0, 3.0)]
    x, y = along(bent, distance_m)
    walked = x if y == 0.0 else 4.0 + y if y < 3.0 else 7.0 + x - 4.0
    assert walked == pytest.approx(min(distance_m, 13.0))


@pytest.mark.parametrize("rolls_after", [1, 30])
def test_it_creeps_after_forty_seconds_until_it_rolls_and_fifteen_ticks_then(rolls_after: int) -> None:
    creep = Creep()
    told = [creep.step(0.0) for _ in range(800 + rolls_after)] + [creep.step(0.5) for _ in range(100)]
    assert told.index(True) == 800
    assert sum(told) == rolls_after + 14


def test_who_moves_now_and_then_does_not_creep() -> None:
    creep = Creep()
    assert not any(creep.step(0.5 if k % 700 == 0 else 0.0) for k in range(3000))
