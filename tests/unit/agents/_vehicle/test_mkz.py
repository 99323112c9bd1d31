"""The agents know the car that they drive: what they ask for is what they get."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._vehicle import mkz
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.simulators.embedded.kernels.mkz import MKZ_STEER_MAX_RAD, mkz_speed, mkz_turn

DT_S = 0.05


@uncached_entry
def speed_after(speed_mps: float, throttle: float, brake: float) -> float:
    return mkz_speed(speed_mps, throttle, brake)


@uncached_entry
def turn_of(speed_mps: float, wheel_rad: float) -> tuple[float, float]:
    return mkz_turn(speed_mps, wheel_rad)


@given(speed_mps=st.floats(0.0, 40.0), wanted=st.floats(-25.0, 10.0))
def test_it_gets_the_acceleration_that_is_wanted_or_the_nearest_there_is(speed_mps: float, wanted: float) -> None:
    throttle, brake = mkz.pedals(speed_mps, wanted)
    assert 0.0 <= throttle <= 1.0
    assert 0.0 <= brake <= 1.0
    found = speed_after(speed_mps, throttle, brake)
    low, high = speed_after(speed_mps, 0.0, 1.0), speed_after(speed_mps, 1.0, 0.0)
    assert found == pytest.approx(min(max(speed_mps + wanted * DT_S, low), high), abs=1e-9)


@given(speed_mps=st.floats(0.0, 40.0), throttle=st.floats(0.0, 1.0), brake=st.floats(0.0, 1.0))
def test_the_agents_know_it_forwards_too(speed_mps: float, throttle: float, brake: float) -> None:
    moved = mkz.moved(speed_mps, Control(throttle, 0.2, brake))
    assert moved.speed_mps == pytest.approx(speed_after(speed_mps, throttle, brake), abs=1e-9)
    slip, yaw_rate = turn_of(1.0, 0.2 * MKZ_STEER_MAX_RAD)
    assert (moved.slip_rad, moved.turn_rad) == pytest.approx((slip, DT_S * yaw_rate))


@given(curvature_per_m=st.floats(-0.26, 0.26))
def test_it_follows_the_curvature_that_is_wanted(curvature_per_m: float) -> None:
    steer = mkz.steer(curvature_per_m)
    assert turn_of(2.0, steer * MKZ_STEER_MAX_RAD)[1] == pytest.approx(2.0 * curvature_per_m, abs=1e-9)


@pytest.mark.parametrize("curvature_per_m", [0.28, 0.7, 5.0])
def test_what_the_wheels_cannot_do_is_all_that_they_can(curvature_per_m: float) -> None:
    assert mkz.steer(curvature_per_m) == 1.0
    assert mkz.steer(-curvature_per_m) == -1.0


def test_it_brakes_at_once_and_pulls_by_and_by() -> None:
    assert mkz.eased(2.0, -3.0) == -3.0
    assert -3.0 < mkz.eased(-3.0, 2.0) < 2.0


def test_wheels_at_a_small_angle_follow_it_over_the_wheelbase() -> None:
    turned = mkz.moved(1.0, Control(0.0, 0.01)).turn_rad
    assert turned / DT_S == pytest.approx(0.01 * mkz.STEER_MAX_RAD / mkz.WHEELBASE_M, rel=1e-3)
