from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from stream_factory import observation_at, observed, started

from pytest_drive_robust.domain.observation import Speed
from pytest_drive_robust.perturbations import Setting, SpeedNoise
from pytest_drive_robust.perturbations.context import Draws

TICKS = range(6000)


@pytest.mark.parametrize(("mean", "negative_share"), [(0.5, 0.0062), (0.2, 0.1587)])
def test_speed_noise_is_a_normal_factor_that_is_not_clipped(mean: float, negative_share: float) -> None:
    factors = np.array([seen.speed.mps / 10.0 for seen in observed(SpeedNoise(mean), TICKS)])
    assert stats.kstest((factors - mean) / 0.2, "norm").pvalue > 1e-3
    assert factors.mean() == pytest.approx(mean, abs=0.011)
    assert factors.std() == pytest.approx(0.2, abs=0.008)
    assert (factors < 0.0).mean() == pytest.approx(negative_share, abs=0.02)


def test_the_first_number_of_a_tick_is_the_factor() -> None:
    clean = observation_at(9)
    noisy = started(SpeedNoise(0.5), route_id="17", seed=3).observe(clean).speed
    assert noisy.mps == (0.5 + 0.2 * Draws(3, "17", "speed-noise").normal("speed", 9)[0]) * clean.speed.mps


def test_clipping_replaces_negative_factors_by_zero_and_leaves_the_others() -> None:
    free = [seen.speed.mps for seen in observed(SpeedNoise(0.2), range(500))]
    clipped = [seen.speed.mps for seen in observed(SpeedNoise(0.2, clip=True), range(500))]
    assert min(free) < 0.0
    assert clipped == [max(0.0, speed) for speed in free]


def test_a_standing_car_is_reported_standing() -> None:
    standing = replace(observation_at(3), speed=Speed(0.0, 3))
    assert started(SpeedNoise(0.5)).observe(standing).speed.mps == 0.0


def test_only_the_speed_changes_and_its_tick_of_capture_stays() -> None:
    clean = observation_at(9)
    slower = started(SpeedNoise(0.5)).observe(clean)
    assert slower.speed.tick == 9
    assert (slower.gps, slower.compass, slower.imu) == (clean.gps, clean.compass, clean.imu)


def test_a_factor_of_one_reports_the_truth() -> None:
    clean = observation_at(4)
    assert started(SpeedNoise(1.0, std=0.0)).observe(clean) == clean


def test_the_noise_does_not_depend_on_what_else_is_in_the_stack() -> None:
    alone = started(SpeedNoise(0.5)).observe(observation_at(7)).speed
    stacked = started(Setting.parse("GPS noise 5 m and occlusion 0.5 and speed noise 0.5")).observe(observation_at(7))
    assert stacked.speed == alone
