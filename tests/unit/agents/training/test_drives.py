"""Driving scores and degradation of driven candidates."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
from result_factory import make_result

from drive_robust_agents.training.drives import degradation, summary
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.result import EpisodeResult


def results(*completion: float) -> list[EpisodeResult]:
    ends = [End.COMPLETED if value == 100.0 else End.STUCK for value in completion]
    return [make_result(str(k), completion_pct=completion[k], end=end) for k, end in enumerate(ends)]


def test_a_summary_holds_means_and_intervals_around_them() -> None:
    found = summary(results(100.0, 100.0, 40.0, 80.0))
    low, high = found["driving_score_interval"]
    assert found["driving_score"] == pytest.approx(80.0)
    assert low < found["driving_score"] < high <= 100.0
    low, high = found["success_rate_interval"]
    assert 0.0 < low < found["success_rate"] < high < 1.0
    assert sum(kind["episodes"] for kind in found["by_type"].values()) == 4


def test_degradation_is_paired_and_unknown_bounds_are_none() -> None:
    found = degradation(results(100.0, 80.0, 90.0), results(50.0, 40.0, 45.0))
    assert found["rd"] == pytest.approx(0.5)
    assert found["rd_interval"] == pytest.approx([0.5, 0.5], abs=1e-6)
    assert degradation(results(50.0), results(25.0))["rd_interval"] == [None, 1.0]
    assert degradation(results(0.0, 0.0), results(1.0, 0.0)) == {"rd": None, "rd_interval": None}
