from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from stream_factory import observation_at, observed, started

from pytest_drive_robust.domain.observation import Speed
from pytest_drive_robust.perturbations import GpsNoise, Setting, SpeedNoise

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


@pytest.mark.parametrize(("mean", "negative_share"), [(0.5, 0.0062), (0.2, 0.1587)])
def test_speed_noise_is_a_normal_factor_that_is_not_clipped(mean: float, negative_share: float) -> None:
    factors = np.array([seen.speed.mps / 10.0 for seen in observed(SpeedNoise(mean), TICKS)])
    assert stats.kstest((factors - mean) / 0.2, "norm").pvalue > 1e-3
    assert factors.mean() == pytest.approx(mean, abs=0.011)
    assert factors.std() == pytest.approx(0.2, abs=0.008)
    assert (factors < 0.0).mean() == pytest.approx(negative_share, abs=0.02)


def test_clipping_replaces_negative_factors_by_zero_and_leaves_the_others() -> None:
    free = [seen.speed.mps for seen in observed(SpeedNoise(0.2), range(500))]
    clipped = [seen.speed.mps for seen in observed(SpeedNoise(0.2, clip=True), range(500))]
    assert min(free) < 0.0
    assert clipped == [max(0.0, speed) for speed in free]


def test_a_standing_car_is_reported_standing() -> None:
    from dataclasses import replace

    standing = replace(observation_at(3), speed=Speed(0.0, 3))
    assert started(SpeedNoise(0.5)).observe(standing).speed.mps == 0.0


def test_only_the_perturbed_signal_changes_and_ticks_of_capture_stay() -> None:
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
    slower = started(SpeedNoise(0.5)).observe(clean)
    assert slower.speed.tick == 9
    assert (slower.gps, slower.compass, slower.imu) == (clean.gps, clean.compass, clean.imu)


def test_zero_noise_reports_the_truth() -> None:
    clean = observation_at(4)
    assert started(GpsNoise(0.0)).observe(clean) == clean
    assert started(SpeedNoise(1.0, std=0.0)).observe(clean) == clean


def test_severities_share_their_random_numbers() -> None:
    # Common random numbers: what differs between 5 m and 15 m is the severity, not the luck.
    small, large = started(GpsNoise(5)).observe(observation_at(0)), started(GpsNoise(15)).observe(observation_at(0))
    assert large.gps.x_m == pytest.approx(3.0 * small.gps.x_m)


def test_two_of_a_kind_draw_different_noise() -> None:
    once = started(GpsNoise(5)).observe(observation_at(0)).gps
    twice = started(GpsNoise(5) + GpsNoise(5)).observe(observation_at(0)).gps
    assert twice.x_m != pytest.approx(2.0 * once.x_m)


def test_the_noise_does_not_depend_on_what_else_is_in_the_stack() -> None:
    alone = started(SpeedNoise(0.5)).observe(observation_at(7)).speed
    stacked = started(Setting.parse("GPS noise 5 m and occlusion 0.5 and speed noise 0.5")).observe(observation_at(7))
    assert stacked.speed == alone


def test_the_record_tells_signal_and_ticks() -> None:
    stack = started(GpsNoise(5) + SpeedNoise(0.5))
    for tick in range(2, 12):
        stack.observe(observation_at(tick))
    spans = [(item.perturbation, item.signal, item.first_tick, item.last_tick) for item in stack.schedule()]
    assert spans == [("gps-noise", "gps", 2, 11), ("speed-noise", "speed", 2, 11)]
