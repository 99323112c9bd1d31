from __future__ import annotations

import math

import numpy as np
import pytest
from result_factory import make_result, trace_of

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.verdict.divergence import first_divergence, first_divergence_s


def drive(ticks: int = 100, **columns: object) -> EpisodeResult:
    return make_result(trace=trace_of(ticks, **columns))


def from_tick(tick: int, value: float, ticks: int = 100) -> np.ndarray:
    values = np.zeros(ticks)
    values[tick:] = value
    return values


def test_identical_episodes_never_diverge() -> None:
    assert first_divergence_s(drive(), drive()) is None


@pytest.mark.parametrize(
    ("column", "small", "large"),
    [("x_m", 0.5, 0.51), ("y_m", -0.5, -0.51), ("speed_mps", 1.0, 1.01)],
)
def test_the_first_tick_that_is_too_far_away_counts(column: str, small: float, large: float) -> None:
    assert first_divergence_s(drive(), drive(**{column: from_tick(30, small)})) is None
    assert first_divergence_s(drive(), drive(**{column: from_tick(30, large)})) == pytest.approx(31 * 0.05)


def test_distance_is_measured_ahead_and_beside_the_clean_ego() -> None:
    # 0.45 m east and 0.45 m south: 0.64 m straight ahead of an ego that heads south-east.
    moved = {"x_m": from_tick(10, 0.45), "y_m": from_tick(10, 0.45)}

    assert first_divergence_s(drive(), drive(**moved)) is None
    assert first_divergence_s(drive(yaw_rad=math.pi / 4), drive(yaw_rad=math.pi / 4, **moved)) == pytest.approx(0.55)


def test_only_common_ticks_are_compared() -> None:
    assert first_divergence_s(drive(), drive(50)) is None
    assert first_divergence_s(drive(20), drive(x_m=from_tick(30, 5.0))) is None
    assert first_divergence_s(drive(), drive(0)) is None


@pytest.mark.parametrize(
    ("column", "change", "signal"),
    [("x_m", 0.6, "in distance"), ("y_m", 0.6, "sideways"), ("speed_mps", 1.2, "in speed")],
)
def test_what_left_its_tolerance_first_is_named(column: str, change: float, signal: str) -> None:
    found = first_divergence(drive(), drive(**{column: from_tick(30, change)}))
    assert found == (pytest.approx(31 * 0.05), signal)
