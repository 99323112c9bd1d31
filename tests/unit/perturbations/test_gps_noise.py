from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from stream_factory import observation_at, observed, started

from pytest_drive_robust.perturbations import GpsNoise, SensorDelay, SpeedNoise
from pytest_drive_robust.perturbations.context import Draws

TICKS = range(6000)


@pytest.mark.parametrize("std_m", [5.0, 15.0])
def test_gps_noise_is_independent_normal_in_both_directions(std_m: float) -> None:
    driven = observed(GpsNoise(std_m), TICKS)
    errors = np.array([(seen.gps.x_m - seen.tick, seen.gps.y_m - 2.0 * seen.tick) for seen in driven])
    for column in errors.T:
        assert stats.kstest(column / std_m, "norm").pvalue > 1e-3
        assert column.mean() == pytest.approx(0.0, abs=4 * std_m / np.sqrt(len(TICKS)))
        assert column.std() == pytest.approx(std_m, rel=0.04)
        assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 0.05  # no drift from tick to tick
    assert abs(np.corrcoef(errors, rowvar=False)[0, 1]) < 0.05


def test_only_the_position_changes_and_its_tick_of_capture_stays() -> None:
    clean = observation_at(9)
    noisy = started(GpsNoise(5)).observe(clean)
    assert noisy.gps != clean.gps
    assert noisy.gps.tick == 9
    assert (noisy.speed, noisy.compass, noisy.imu, noisy.cameras) == (
        clean.speed,
        clean.compass,
        clean.imu,
        clean.cameras,
    )


def test_zero_noise_reports_the_truth() -> None:
    clean = observation_at(4)
    assert started(GpsNoise(0.0)).observe(clean) == clean


def test_the_first_two_numbers_of_a_tick_are_the_errors_to_the_east_and_to_the_south() -> None:
    clean = observation_at(9)
    noisy = started(GpsNoise(5), route_id="17", seed=3).observe(clean).gps
    east, south, _, _ = Draws(3, "17", "gps-noise").normal("gps", 9)
    assert (noisy.x_m, noisy.y_m) == (clean.gps.x_m + 5.0 * east, clean.gps.y_m + 5.0 * south)


def test_a_fix_that_arrives_once_more_is_off_by_another_error() -> None:
    stack = started(SensorDelay(camera_ms=200) + GpsNoise(5) + SpeedNoise(0.5))
    seen = [stack.observe(observation_at(tick)) for tick in range(4)]
    assert {one.gps.tick for one in seen} == {one.speed.tick for one in seen} == {0}
    assert len({one.gps.x_m for one in seen}) == len({one.speed.mps for one in seen}) == 4


def test_severities_share_their_random_numbers() -> None:
    # Common random numbers: what differs between 5 m and 15 m is the severity, not the luck.
    small, large = started(GpsNoise(5)).observe(observation_at(0)), started(GpsNoise(15)).observe(observation_at(0))
    assert large.gps.x_m == pytest.approx(3.0 * small.gps.x_m)


def test_two_of_a_kind_draw_different_noise() -> None:
    once = started(GpsNoise(5)).observe(observation_at(0)).gps
    twice = started(GpsNoise(5) + GpsNoise(5)).observe(observation_at(0)).gps
    assert twice.x_m != pytest.approx(2.0 * once.x_m)


def test_the_record_tells_signal_and_ticks() -> None:
    stack = started(GpsNoise(5) + SpeedNoise(0.5))
    for tick in range(2, 12):
        stack.observe(observation_at(tick))
    spans = [(item.perturbation, item.signal, item.first_tick, item.last_tick) for item in stack.schedule()]
    assert spans == [("gps-noise", "gps", 2, 11), ("speed-noise", "speed", 2, 11)]
