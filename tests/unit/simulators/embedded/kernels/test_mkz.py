"""How the ego answers: as CARLA's was fitted, and sensibly where the fits say nothing."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from fitted_mkz import BRAKE, FITTED_THROTTLE, fitted_speed, fitted_yaw_rate
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.mkz import MKZ_STEER_MAX_RAD, mkz_speed, mkz_turn
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.simulators.embedded.world import World

DT_S = 0.05
SPEEDS = (0.0, 2.0, 5.0, 8.0, 12.0, 18.0, 25.0)
PUBLISHED = {
    0.3: (0.24, -0.31, -0.93, -1.33, -1.49, -0.95),
    0.5: (1.37, 1.08, 0.72, 0.45, 0.25, 0.28, 0.80),
    0.75: (3.88, 3.61, 3.21, 2.85, 2.40, 1.81, 1.26),
    1.0: (7.61, 7.02, 6.20, 5.43, 4.51, 3.34, 2.30),
}
BRAKES = (-21.0, -18.0, -9.9, -7.0, -7.9, -6.6)
SHARES = st.floats(0.0, 1.0)
MPS = st.one_of(st.floats(0.0, 60.0), st.floats(0.0, 0.1))


@uncached_entry
def speed_after(speed_mps: float, throttle: float, brake: float) -> float:
    return mkz_speed(speed_mps, throttle, brake)


@uncached_entry
def turn_of(speed_mps: float, wheel_rad: float) -> tuple[float, float]:
    return mkz_turn(speed_mps, wheel_rad)


def acceleration(speed_mps: float, throttle: float, brake: float = 0.0) -> float:
    return (speed_after(speed_mps, throttle, brake) - speed_mps) / DT_S


@pytest.mark.parametrize("throttle", PUBLISHED)
def test_throttle_accelerates_as_the_table_of_the_fit_says(throttle: float) -> None:
    found = [acceleration(v, throttle) for v in SPEEDS[: len(PUBLISHED[throttle])]]
    assert found == pytest.approx(PUBLISHED[throttle], abs=0.0051)


def test_the_brake_decelerates_as_the_table_of_the_fit_says() -> None:
    found = [acceleration(v, 0.0, 1.0) for v in SPEEDS[1:]]
    assert found == pytest.approx(BRAKES, rel=0.03)


@pytest.mark.parametrize(("steer", "yaw_rate"), [(0.1, 0.139), (0.3, 0.415), (1.0, 1.345)])
def test_it_turns_as_the_fit_says(steer: float, yaw_rate: float) -> None:
    for side in (-1.0, 1.0):
        assert turn_of(5.0, side * steer * MKZ_STEER_MAX_RAD)[1] == pytest.approx(side * yaw_rate, abs=0.0006)


@given(speed_mps=st.floats(0.0, 25.0), throttle=st.floats(0.3, 1.0))
def test_throttle_is_the_fit_where_it_holds(speed_mps: float, throttle: float) -> None:
    if speed_mps <= 18.0 or throttle >= 0.5:
        fitted = max(fitted_speed(speed_mps, throttle, FITTED_THROTTLE), 0.0)
        assert speed_after(speed_mps, throttle, 0.0) == pytest.approx(fitted, abs=1e-9)


@given(speed_mps=st.floats(0.1, 25.0))
def test_full_brakes_are_the_fit_where_it_holds(speed_mps: float) -> None:
    assert speed_after(speed_mps, 0.0, 1.0) == pytest.approx(fitted_speed(speed_mps, 0.0, BRAKE), abs=1e-9)


@given(speed_mps=MPS, throttle=SHARES, brake=SHARES)
def test_it_never_reverses_and_stays_finite(speed_mps: float, throttle: float, brake: float) -> None:
    after = speed_after(speed_mps, throttle, brake)
    assert math.isfinite(after)
    assert after >= 0.0


@given(speed_mps=MPS, brake=SHARES, pair=st.tuples(SHARES, SHARES).map(sorted))
def test_more_throttle_never_gives_less(speed_mps: float, brake: float, pair: list[float]) -> None:
    less, more = (speed_after(speed_mps, throttle, brake) for throttle in pair)
    assert more >= less - 1e-12


@given(speed_mps=MPS, throttle=SHARES, pair=st.tuples(SHARES, SHARES).map(sorted))
def test_more_brake_never_gives_more(speed_mps: float, throttle: float, pair: list[float]) -> None:
    less, more = (speed_after(speed_mps, throttle, brake) for brake in pair)
    assert more <= less + 1e-12


@given(speed_mps=st.floats(1e-6, 60.0))
def test_coasting_slows_down(speed_mps: float) -> None:
    assert speed_after(speed_mps, 0.0, 0.0) < speed_mps


@given(speed_mps=MPS, throttle=SHARES, brake=SHARES)
def test_a_little_more_of_anything_changes_little(speed_mps: float, throttle: float, brake: float) -> None:
    here = speed_after(speed_mps, throttle, brake)
    for there in ((speed_mps + 1e-7, throttle, brake), (speed_mps, throttle + 1e-7, brake)):
        assert abs(speed_after(*there) - here) < 1e-5
    assert abs(speed_after(speed_mps, throttle, brake + 1e-7) - here) < 1e-5


@given(speed_mps=MPS, steer=st.floats(-1.0, 1.0))
def test_steering_is_symmetric_and_keeps_its_grip(speed_mps: float, steer: float) -> None:
    slip, yaw_rate = turn_of(speed_mps, steer * MKZ_STEER_MAX_RAD)
    assert turn_of(speed_mps, -steer * MKZ_STEER_MAX_RAD) == (-slip, -yaw_rate)
    assert abs(yaw_rate) * speed_mps <= 10.0
    if abs(fitted_yaw_rate(speed_mps, steer)) * speed_mps <= 7.0:
        assert yaw_rate == pytest.approx(fitted_yaw_rate(speed_mps, steer), abs=1e-9)


@given(speed_mps=MPS, pair=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)).map(sorted))
def test_more_steering_never_turns_less(speed_mps: float, pair: list[float]) -> None:
    less, more = (turn_of(speed_mps, steer * MKZ_STEER_MAX_RAD)[1] for steer in pair)
    assert more >= less - 1e-12


def driven(*controls: tuple[Control, int]) -> World:
    route = next(route for route in named_routes("full") if route.scenario.type == "DynamicObjectCrossing")
    world = World(route, seed=0)
    for control, ticks in controls:
        for _ in range(ticks):
            world.tick(control)
    return world


def test_the_ego_of_a_world_moves_as_the_fit_says_and_comes_to_rest() -> None:
    world = driven((Control(throttle=0.8), 40))
    before = world.now().ego
    world.tick(Control(throttle=0.8, steer=0.2))
    after = world.now().ego
    assert after.speed_mps == pytest.approx(fitted_speed(before.speed_mps, 0.8, FITTED_THROTTLE), abs=1e-9)
    assert after.yaw_rate_radps == pytest.approx(fitted_yaw_rate(before.speed_mps, 0.2), abs=1e-9)
    assert after.yaw_rad - before.yaw_rad == pytest.approx(after.yaw_rate_radps * DT_S)
    assert math.hypot(after.x_m - before.x_m, after.y_m - before.y_m) == pytest.approx(before.speed_mps * DT_S)
    for _ in range(100):
        world.tick(Control(brake=1.0))
    assert world.now().ego.speed_mps == 0.0
    there = world.state.ego[:3].copy()
    world.tick(Control(brake=1.0, steer=1.0))
    assert np.array_equal(world.state.ego[:3], there)


def test_put_elsewhere_its_wheels_stay_turned() -> None:
    world = driven((Control(throttle=0.7), 30), (Control(throttle=0.7, steer=0.2), 1))
    world.place_ego(0.0, 0.0, 0.0, 6.0)
    ego = world.now().ego
    assert ego.yaw_rate_radps == pytest.approx(fitted_yaw_rate(6.0, 0.2), abs=1e-9)
    assert ego.right_mps2 == pytest.approx(6.0 * ego.yaw_rate_radps)


def test_full_brakes_stop_it_within_less_than_half_a_second() -> None:
    world = driven((Control(throttle=0.7), 80))
    world.place_ego(0.0, 0.0, 0.0, 5.0)
    speeds = []
    while world.state.ego[c.EGO_V] > 0.0:
        world.tick(Control(brake=1.0))
        speeds.append(float(world.state.ego[c.EGO_V]))
    assert all(after <= before for before, after in pairwise(speeds))
    assert len(speeds) < 10


def test_its_bits_are_these() -> None:
    """The polynomials are plain sums and products in a fixed order: the same double everywhere."""
    told = [speed_after(v, u, b).hex() for v, u, b in ((7.3, 0.62, 0.0), (7.3, 0.1, 0.4), (23.0, 0.35, 0.0))]
    told += [value.hex() for value in turn_of(11.0, 0.21)]
    assert told == [
        "0x1.d87192d4b7c84p+2",
        "0x1.c16a56294565ep+2",
        "0x1.6f882378601e3p+4",
        "0x1.c6d908d8b6574p-4",
        "0x1.b56e9aa2abbcfp-1",
    ]
