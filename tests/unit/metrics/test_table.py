from __future__ import annotations

import functools
import re
import statistics
from collections.abc import Sequence

import pytest
from result_factory import make_result, scored

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.summary import summarize
from pytest_drive_robust.metrics.table import METRICS, Metric


def mean_ticks(results: Sequence[EpisodeResult]) -> float:
    """How long the episodes were.

    In ticks.
    """
    return sum(result.ticks for result in results) / len(results)


def test_the_table_agrees_with_the_summary() -> None:
    results = [scored("1", 40.0), scored("2", 100.0)]
    summary = summarize(results)

    assert METRICS["DS"].measure(results) == summary.ds
    assert METRICS["SR"].measure(results) == summary.sr
    assert METRICS["efficiency"].measure(results) == summary.efficiency
    assert METRICS["comfort"].measure(results) == summary.comfort


def test_the_mode_reaches_the_metrics() -> None:
    results = [make_result("1", speed_ratios_pct=[]), make_result("2", speed_ratios_pct=[80.0])]

    assert METRICS["efficiency"].measure(results) == 80.0
    assert METRICS["efficiency"].measure(results, mode="fixed") == 40.0


def test_what_a_judge_reads_of_a_route_is_the_mean_over_its_seeds_and_none_without_data() -> None:
    clean = [scored("1", score, seed=seed) for seed, score in enumerate((100.0, 60.0))]
    late = [scored("1", score, seed=seed, setting="200 ms latency") for seed, score in enumerate((50.0, 20.0))]
    silent = [make_result(speed_ratios_pct=[])]

    assert METRICS["RD"].of_route(late, clean=clean) == (35.0, 80.0)
    assert METRICS["DS"].of_route(late, clean=clean) == (35.0, 0.0)
    assert METRICS["efficiency"].of_route(silent) is None
    assert METRICS["efficiency"].of_route(silent, mode="fixed") == (0.0, 0.0)


def test_only_rd_needs_the_clean_episodes() -> None:
    assert [name for name, metric in METRICS.items() if metric.needs_clean] == ["RD"]
    clean, perturbed = [scored("1", 80.0)], [scored("1", 60.0, setting="occlusion 0.5")]
    assert METRICS["RD"].measure(perturbed, clean=clean) == 0.25
    with pytest.raises(ComparisonError, match="clean set holds no episode"):
        METRICS["RD"].measure(perturbed)


def test_a_function_of_a_user_becomes_a_metric() -> None:
    metric = Metric.from_function("ticks", mean_ticks)

    assert metric.meaning == "How long the episodes were."
    assert metric.measure([make_result()]) == 40.0
    assert not metric.needs_clean


def test_a_function_with_arguments_of_its_own_keeps_its_meaning_and_one_without_words_has_its_name() -> None:
    def share(results: Sequence[EpisodeResult], of: float) -> float:
        """
        A share.
        """
        return of

    def silent(results: Sequence[EpisodeResult]) -> float:
        """ """
        return 0.0

    assert Metric.from_function("share", functools.partial(share, of=0.5)).meaning == "A share."
    assert Metric.from_function("silent", silent).meaning == "silent"


def test_what_a_function_of_a_user_raises_is_an_error_that_names_its_line() -> None:
    def broken(results: Sequence[EpisodeResult]) -> float:
        return len(results) / 0

    line = broken.__code__.co_firstlineno + 1
    with pytest.raises(ComparisonError) as raised:
        Metric.from_function("bumps", broken).measure([make_result()])
    assert str(raised.value) == f"the metric bumps raised ZeroDivisionError: division by zero ({__file__}:{line})"
    assert isinstance(raised.value.__cause__, ZeroDivisionError)

    def asking(results: Sequence[EpisodeResult]) -> float:
        return statistics.stdev([float(len(results))])

    line = asking.__code__.co_firstlineno + 1
    with pytest.raises(ComparisonError, match=rf"StatisticsError: .* \({re.escape(__file__)}:{line}\)$"):
        Metric.from_function("bumps", asking).measure([make_result()])
    with pytest.raises(ComparisonError, match=r"^the metric bumps raised TypeError: .*'EpisodeResult'$"):
        Metric.from_function("bumps", sum).measure([make_result()])


def test_what_a_function_of_a_user_finds_not_comparable_is_said_in_its_words() -> None:
    def refusing(results: Sequence[EpisodeResult]) -> float:
        raise ComparisonError("no bump is known")

    with pytest.raises(ComparisonError, match=r"^no bump is known$"):
        Metric.from_function("bumps", refusing).measure([make_result()])


def test_a_metric_without_data_is_none_and_printed_as_a_dash() -> None:
    assert METRICS["efficiency"].measure([make_result(speed_ratios_pct=[])]) is None
    assert METRICS["efficiency"].format(None) == "-"
    assert METRICS["DS"].format(61.25) == "61.25"


@pytest.mark.parametrize(
    ("name", "limit", "text"),
    [("RD", 0.3, "0.30"), ("SR", 1.0, "1.00"), ("RD", 0.125, "0.125"), ("DS", 40.0, "40"), ("DS", 62.5, "62.5"),
     ("efficiency", 1234567.0, "1234567.0")],
)  # fmt: skip
def test_limits_are_printed_exactly(name: str, limit: float, text: str) -> None:
    assert METRICS[name].format_limit(limit) == text
    assert float(text) == limit


@pytest.mark.parametrize("name", METRICS)
def test_metrics_of_no_episode_are_refused(name: str) -> None:
    with pytest.raises(ComparisonError):
        METRICS[name].measure([])
