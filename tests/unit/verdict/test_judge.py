from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from result_factory import crashed_simulation, make_result, scored, trace_of

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.stats.intervals import ratio_interval, share_interval
from pytest_drive_robust.verdict.evaluate import judge, measure
from pytest_drive_robust.verdict.parse import parse_requirement

LATE = "200 ms latency"
RD = "RD under 200 ms latency <= 0.30"


def drives(scores: Sequence[float], *, setting: str = "clean", seed: int = 0) -> list[EpisodeResult]:
    return [scored(str(route), score, setting=setting, seed=seed) for route, score in enumerate(scores)]


def test_rd_within_the_limit_passes_with_value_interval_and_both_summaries() -> None:
    clean, late = drives([100.0, 80.0, 60.0, 80.0]), drives([90.0, 60.0, 60.0, 30.0], setting=LATE)
    verdict = judge(parse_requirement(RD), agent="driver", clean=clean, perturbed=late)

    assert verdict.passed
    assert verdict.value == 0.25
    assert (verdict.low, verdict.high) == ratio_interval([100.0, 80.0, 60.0, 80.0], [90.0, 60.0, 60.0, 30.0])
    assert verdict.clean is not None
    assert (verdict.clean.ds, verdict.perturbed.ds) == (80.0, 60.0)
    assert (verdict.routes, verdict.seeds) == (4, 1)
    assert [route.route_id for route in verdict.worst] == ["3", "1", "0"]


@pytest.mark.parametrize(
    ("sentence", "passed"),
    [
        ("RD under 200 ms latency <= 0.25", True),
        ("RD under 200 ms latency <= 0.24", False),
        ("RD under 200 ms latency >= 0.25", True),
        ("RD under 200 ms latency >= 0.26", False),
        ("DS under 200 ms latency >= 60", True),
        ("DS under 200 ms latency >= 60.5", False),
        ("SR under 200 ms latency >= 0.01", False),
        ("SR under 200 ms latency <= 0", True),
        ("comfort under 200 ms latency >= 90", True),
        ("efficiency under 200 ms latency >= 100.1", False),
    ],
)
def test_a_value_passes_on_its_side_of_the_limit_or_on_it(sentence: str, passed: bool) -> None:
    clean, late = drives([80.0, 80.0]), drives([90.0, 30.0], setting=LATE)

    assert judge(parse_requirement(sentence), agent="driver", clean=clean, perturbed=late).passed is passed


def test_an_absolute_requirement_needs_no_clean_episode() -> None:
    verdict = judge(
        parse_requirement("SR under clean >= 0.5"), agent="driver", clean=[], perturbed=drives([100.0, 100.0, 10.0])
    )

    assert verdict.passed
    assert verdict.clean is None
    assert (verdict.low, verdict.high) == share_interval([1.0, 1.0, 0.0])
    assert [route.route_id for route in verdict.worst] == ["2"]
    assert verdict.worst[0].clean_outcome == "not driven"


def test_several_seeds_are_counted_and_do_not_multiply_the_routes() -> None:
    once = drives([100.0, 40.0])
    verdict = judge(
        parse_requirement("DS under clean >= 60"),
        agent="driver",
        clean=[],
        perturbed=[*once, *drives([100.0, 40.0], seed=1)],
    )
    single = judge(parse_requirement("DS under clean >= 60"), agent="driver", clean=[], perturbed=once)

    assert (verdict.routes, verdict.seeds) == (2, 2)
    assert (verdict.low, verdict.high) == (single.low, single.high)


def test_one_route_has_the_whole_range_as_its_interval() -> None:
    late = drives([50.0], setting=LATE)
    rd = judge(parse_requirement(RD), agent="driver", clean=drives([100.0]), perturbed=late)
    ds = judge(parse_requirement("DS under 200 ms latency >= 40"), agent="driver", clean=[], perturbed=late)

    assert (rd.low, rd.high) == (-math.inf, 1.0)
    assert (ds.low, ds.high) == (0.0, 100.0)


def test_no_data_for_a_metric_is_an_error_and_never_passes() -> None:
    silent = [make_result(speed_ratios_pct=[], trace=trace_of(1))]

    for metric in ("efficiency", "comfort"):
        with pytest.raises(ComparisonError, match=f"hold no data for {metric}"):
            judge(parse_requirement(f"{metric} under clean <= 50"), agent="driver", clean=[], perturbed=silent)


def test_the_mode_decides_what_counts() -> None:
    stuck = [make_result("1", speed_ratios_pct=[]), make_result("2", speed_ratios_pct=[100.0])]
    sentence = parse_requirement("efficiency under clean >= 80")

    assert judge(sentence, agent="driver", clean=[], perturbed=stuck).passed
    assert not judge(sentence, agent="driver", clean=[], perturbed=stuck, mode="fixed").passed


def test_episodes_that_do_not_belong_are_refused() -> None:
    clean, late = drives([100.0, 50.0]), drives([100.0, 50.0], setting=LATE)
    sentence = parse_requirement(RD)
    cases = [
        ("so there is nothing to judge", {"agent": "driver", "clean": clean, "perturbed": []}),
        ("clean set holds no episode", {"agent": "driver", "clean": [], "perturbed": late}),
        ("under '200 ms latency', but got", {"agent": "driver", "clean": clean, "perturbed": clean}),
        ("under 'clean', but got", {"agent": "driver", "clean": late, "perturbed": late}),
        ("agent 'other'", {"agent": "other", "clean": clean, "perturbed": late}),
        ("differ in their", {"agent": "driver", "clean": clean[:1], "perturbed": late}),
        ("infra_error", {"agent": "driver", "clean": [*clean, crashed_simulation("9")], "perturbed": late}),
        ("is 0 on all 2 routes", {"agent": "driver", "clean": drives([0.0, 0.0]), "perturbed": late}),
    ]

    for message, given in cases:
        with pytest.raises(ComparisonError, match=message):
            judge(sentence, **given)  # type: ignore[arg-type]


def test_a_users_metric_is_measured_with_a_jackknife_interval() -> None:
    metric = Metric.from_function("ticks", lambda results: sum(result.ticks for result in results) / len(results))
    results = [make_result(str(ticks), trace=trace_of(ticks)) for ticks in (10, 20, 60)]
    value, (low, high) = measure(metric, clean=[], perturbed=results)

    assert value == 30.0
    # mean 30, sd 26.4575, t(2; 0.975) = 4.302653
    assert (low, high) == pytest.approx((30 - 65.72, 30 + 65.72), abs=0.01)


@pytest.mark.parametrize("nothing", [None, math.nan, math.inf])
def test_a_users_metric_without_a_finite_value_is_an_error(nothing: float | None) -> None:
    metric = Metric.from_function("nothing", lambda results: nothing)

    with pytest.raises(ComparisonError, match="nothing"):
        measure(metric, clean=[], perturbed=[make_result()])


def test_a_value_that_nobody_read_route_by_route_promises_nothing():
    clean = [scored("1", 100.0), scored("2", 100.0)]
    wanted = parse_requirement("DS under clean >= 60")
    verdict = judge(wanted, agent="driver", clean=[], perturbed=clean, verdict_rule=VerdictRule())
    assert (verdict.verdict_rule.kind, verdict.decision, verdict.margin) == ("point", "pass", 0.0)
