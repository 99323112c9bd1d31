"""The position filter against what follows from the published noises: it forgives the GPS and believes the speed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from drive_robust_agents._vehicle import mkz
from drive_robust_agents._wrappers.kalman import PositionFilter, published_motion
from pytest_drive_robust import Control

Floats = NDArray[np.float64]
ROLLING = Control(throttle=0.06)


def straight(
    *, gps_m: float = 0.0, speed_share: float = 1.0, ticks: int = 800, seed: int = 0, mps: float = 6.0
) -> Floats:
    """(ticks, 2): the errors of the estimate, forward and right, while driving straight at 6 m/s."""
    draw, found, errors = np.random.default_rng(seed), PositionFilter(), np.empty((ticks, 2))
    for k in range(ticks):
        x, noise = 0.05 * mps * k, gps_m * draw.standard_normal(2)
        told = found.step(x + noise[0], noise[1], 0.0, speed_share * mps, ROLLING)
        errors[k] = told.x_m - x, told.y_m
    return errors


@pytest.mark.parametrize(
    ("gps_m", "at_first_m", "then_m", "settled_m"), [(5.0, 1.6, 0.5, 0.4), (15.0, 4.9, 1.6, 1.3)], ids=["5 m", "15 m"]
)
def test_gps_noise_averages_out_as_the_published_noises_say(
    gps_m: float, at_first_m: float, then_m: float, settled_m: float
) -> None:
    errors = np.stack([straight(gps_m=gps_m, seed=seed) for seed in range(8)])
    spans = (slice(0, 40), slice(40, 200), slice(400, None))
    rms = [float(np.sqrt((errors[:, span] ** 2).mean())) for span in spans]
    assert rms == pytest.approx([at_first_m, then_m, settled_m], rel=0.25)


@pytest.mark.parametrize(
    ("share", "after_s"),
    [(0.5, {1: -1.6, 3: -4.1, 10: -9.7, 60: -10.5}), (0.2, {1: -2.5, 3: -6.7, 10: -15.3, 60: -16.9})],
)
def test_a_speedometer_that_reads_low_leaves_the_estimate_behind(share: float, after_s: dict[int, float]) -> None:
    behind = straight(speed_share=share, ticks=1201)[:, 0]
    assert [behind[20 * seconds] for seconds in after_s] == pytest.approx(list(after_s.values()), rel=0.1)


def test_exact_sensors_give_the_exact_place() -> None:
    assert np.abs(straight(ticks=200)).max() < 0.01


@pytest.mark.parametrize(
    ("told_ticks", "behind_m"), [(1, {5: 9.6, 20: 25.0}), (2, {5: 0.0, 20: 0.0})], ids=["published", "elapsed"]
)
def test_called_every_second_tick_it_falls_behind_unless_it_is_told_so(
    told_ticks: int, behind_m: dict[int, float]
) -> None:
    found, behind = PositionFilter(), {}
    for tick in range(0, 401, 2):
        told = found.step(0.4 * tick, 0.0, 0.0, 8.0, ROLLING, told_ticks)
        behind[tick] = 0.4 * tick - told.x_m
    assert [behind[20 * seconds] for seconds in behind_m] == pytest.approx(list(behind_m.values()), rel=0.1, abs=0.1)


def test_ticks_of_which_nothing_was_measured_are_predicted_one_by_one() -> None:
    at_once, one_by_one = PositionFilter(), PositionFilter()
    last = Control(throttle=0.5, steer=0.3)
    for found in (at_once, one_by_one):
        found.step(0.0, 0.0, 0.2, 5.0, last)
    for _ in range(3):
        one_by_one.step(math.nan, math.nan, math.nan, math.nan, last)
    assert at_once.step(1.0, 0.1, 0.3, 5.5, last, 4) == one_by_one.step(1.0, 0.1, 0.3, 5.5, last)


def test_in_a_bend_it_follows_the_compass() -> None:
    found, yaw, x, y = PositionFilter(), 0.0, 0.0, 0.0
    tangent = 2.85 / 20.0
    slip = math.atan(0.5 * tangent)
    for _ in range(200):
        last = Control(throttle=0.06, steer=math.atan(tangent) / 0.61)
        told = found.step(x, y, math.remainder(yaw, math.tau), 5.0, last)
        assert math.hypot(told.x_m - x, told.y_m - y) < 0.3
        x, y = x + 0.25 * math.cos(yaw + slip), y + 0.25 * math.sin(yaw + slip)
        yaw += 0.25 * math.cos(slip) * tangent / 2.85


def test_a_compass_that_says_nan_leaves_the_yaw_to_the_command() -> None:
    found = PositionFilter()
    found.step(0.0, 0.0, 1.0, 5.0, ROLLING)
    assert found.step(0.1, 0.2, math.nan, 5.0, ROLLING).yaw_rad == pytest.approx(1.0)


def test_the_first_estimate_is_the_first_measurement() -> None:
    assert PositionFilter().step(3.0, 4.0, 0.5, 6.0, Control()) == (3.0, 4.0, 0.5, 6.0)


@given(st.integers(0, 2**31), st.floats(-3.0, 3.0))
def test_it_knows_no_preferred_direction(seed: int, turned: float) -> None:
    draw, plain, rotated = np.random.default_rng(seed), PositionFilter(), PositionFilter()
    c, s = math.cos(turned), math.sin(turned)
    for _ in range(30):
        x, y, yaw = draw.normal(0.0, 5.0, 3)
        last = Control(throttle=float(draw.uniform()), steer=float(draw.uniform(-1.0, 1.0)))
        one = plain.step(x, y, yaw, 4.0, last)
        other = rotated.step(c * x - s * y, s * x + c * y, yaw + turned, 4.0, last)
    assert (other.x_m, other.y_m) == pytest.approx((c * one.x_m - s * one.y_m, s * one.x_m + c * one.y_m), abs=1e-6)


def test_the_published_car_turns_as_the_mkz_and_hardly_accelerates() -> None:
    given = Control(throttle=1.0, steer=0.3)
    found, ours = published_motion(5.0, given), mkz.moved(5.0, given)
    assert (found.slip_rad, found.turn_rad) == (ours.slip_rad, ours.turn_rad)
    assert found.speed_mps == pytest.approx(5.0 + 0.05 * 0.5633837)
    assert published_motion(5.0, Control(brake=0.1)).speed_mps == pytest.approx(5.0 - 0.05 * 4.952399)
