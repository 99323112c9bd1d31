"""Verdicts from episodes: what is judged, what is refused, and what says nothing."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any

import pytest
from result_factory import crashed_simulation, make_result, scored, trace_of

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.stats.evidence import fail_p_value
from pytest_drive_robust.stats.intervals import (
    evidence_interval,
    mean_evidence_interval,
    ratio_interval,
    share_interval,
)
from pytest_drive_robust.verdict.evaluate import Verdict, evaluate, measure
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.requirement import Requirement
from pytest_drive_robust.verdict.sentences import requirements

LATE = "200 ms latency"
RD = "RD under 200 ms latency <= 0.30"


def drives(scores: Sequence[float], *, setting: str = "clean", seed: int = 0) -> list[EpisodeResult]:
    return [scored(str(route), score, setting=setting, seed=seed) for route, score in enumerate(scores)]


def test_rd_within_the_limit_passes_with_value_interval_and_both_summaries() -> None:
    clean, late = drives([100.0, 80.0, 60.0, 80.0]), drives([90.0, 60.0, 60.0, 30.0], setting=LATE)
    verdict = evaluate(requirements(RD)[0], agent="driver", clean=clean, perturbed=late)

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

    assert evaluate(requirements(sentence)[0], agent="driver", clean=clean, perturbed=late).passed is passed


def test_an_absolute_requirement_needs_no_clean_episode() -> None:
    verdict = evaluate(
        requirements("SR under clean >= 0.5")[0], agent="driver", clean=[], perturbed=drives([100.0, 100.0, 10.0])
    )

    assert verdict.passed
    assert verdict.clean is None
    assert (verdict.low, verdict.high) == share_interval([1.0, 1.0, 0.0])
    assert [route.route_id for route in verdict.worst] == ["2"]
    assert verdict.worst[0].clean_outcome == "not driven"


def test_several_seeds_are_counted_and_do_not_multiply_the_routes() -> None:
    once = drives([100.0, 40.0])
    verdict = evaluate(
        requirements("DS under clean >= 60")[0],
        agent="driver",
        clean=[],
        perturbed=[*once, *drives([100.0, 40.0], seed=1)],
    )
    single = evaluate(requirements("DS under clean >= 60")[0], agent="driver", clean=[], perturbed=once)

    assert (verdict.routes, verdict.seeds) == (2, 2)
    assert (verdict.low, verdict.high) == (single.low, single.high)


def test_one_route_has_the_whole_range_as_its_interval() -> None:
    late = drives([50.0], setting=LATE)
    rd = evaluate(requirements(RD)[0], agent="driver", clean=drives([100.0]), perturbed=late)
    ds = evaluate(requirements("DS under 200 ms latency >= 40")[0], agent="driver", clean=[], perturbed=late)

    assert (rd.low, rd.high) == (-math.inf, 1.0)
    assert (ds.low, ds.high) == (0.0, 100.0)


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
@pytest.mark.parametrize("clean", [0.001, 29.9])
def test_below_the_floor_of_the_clean_score_a_degradation_never_passes_by_any_rule(kind: str, clean: float) -> None:
    def verdict(perturbed: float, decision: str) -> Verdict:
        return evaluate(
            requirements(RD)[0],
            agent="driver",
            clean=drives([clean] * 4),
            perturbed=drives([perturbed] * 4, setting=LATE),
            verdict_rule=VerdictRule(kind),
            decision=None if kind == "point" else decision,
        )

    better, worse = verdict(90.0, "pass"), verdict(0.0, "fail")

    assert (better.decision, better.passed) == ("inconclusive", False)
    assert (worse.decision, worse.passed) == ("fail", False)
    for found in (better, worse):
        assert found.reason == f"the clean driving score is {clean:.1f}, below the floor of 30: RD says nothing yet"


def test_at_the_floor_a_degradation_counts_and_other_metrics_have_no_floor() -> None:
    late = drives([25.0] * 4, setting=LATE)
    at_the_floor = evaluate(requirements(RD)[0], agent="driver", clean=drives([30.0] * 4), perturbed=late)
    score = evaluate(
        requirements("DS under 200 ms latency >= 20")[0], agent="driver", clean=drives([1.0] * 4), perturbed=late
    )

    assert (at_the_floor.decision, at_the_floor.reason) == ("pass", "")
    assert (score.decision, score.reason) == ("pass", "")


@pytest.mark.parametrize(("floor", "decision"), [(25.0, "pass"), (25.1, "inconclusive")])
def test_the_floor_is_that_of_the_rule(floor: float, decision: str) -> None:
    verdict = evaluate(
        requirements(RD)[0],
        agent="driver",
        clean=drives([25.0] * 4),
        perturbed=drives([25.0] * 4, setting=LATE),
        verdict_rule=VerdictRule("point", clean_floor=floor),
    )

    assert verdict.decision == decision


def test_no_data_for_a_metric_is_an_error_and_never_passes() -> None:
    silent = [make_result(speed_ratios_pct=[], trace=trace_of(1))]

    for metric in ("efficiency", "comfort"):
        with pytest.raises(ComparisonError, match=f"hold no data for {metric}"):
            evaluate(requirements(f"{metric} under clean <= 50")[0], agent="driver", clean=[], perturbed=silent)


def test_the_mode_decides_what_counts() -> None:
    stuck = [make_result("1", speed_ratios_pct=[]), make_result("2", speed_ratios_pct=[100.0])]
    sentence = requirements("efficiency under clean >= 80")[0]

    assert evaluate(sentence, agent="driver", clean=[], perturbed=stuck).passed
    assert not evaluate(sentence, agent="driver", clean=[], perturbed=stuck, mode="fixed").passed


@pytest.mark.parametrize("decision", [None, "pass"])
def test_the_mode_decides_what_the_interval_is_of(decision: str | None) -> None:
    stuck = [make_result(str(number), speed_ratios_pct=[100.0] if number % 2 else []) for number in range(40)]
    verdict = evaluate(
        requirements("efficiency under clean >= 20")[0],
        agent="driver",
        clean=[],
        perturbed=stuck,
        mode="fixed",
        verdict_rule=VerdictRule("evidence"),
        decision=decision,
    )

    assert verdict.value == 50.0
    assert verdict.low < 50.0 < verdict.high


@pytest.mark.parametrize("planned", [24, 60])
def test_the_interval_of_a_mean_by_evidence_is_that_of_its_rule_and_comparison(planned: int) -> None:
    scores = [60.0, 20.0, 90.0, 55.0] * 6
    verdict = evaluate(
        requirements("DS under clean <= 60")[0],
        agent="driver",
        clean=[],
        perturbed=drives(scores),
        verdict_rule=VerdictRule("evidence", alpha=0.01),
        decision="inconclusive",
        planned=planned,
    )
    ended = planned == 24
    assert (verdict.low, verdict.high) == mean_evidence_interval(
        scores, 0.01, low=0.0, high=100.0, ended=ended, comparison="<="
    )


@pytest.mark.parametrize(("kind", "margin"), [("evidence", 10.0), ("list", 0.0)])
def test_the_margin_is_that_of_a_rule_that_has_one(kind: str, margin: float) -> None:
    wanted = requirements("DS under clean >= 60")[0]
    rule = VerdictRule(kind)
    verdict = evaluate(wanted, agent="driver", clean=[], perturbed=drives([70.0]), verdict_rule=rule, decision="pass")
    assert verdict.margin == margin


@pytest.mark.parametrize("planned", [24, 60])
def test_the_interval_of_evidence_is_that_of_its_rule_and_comparison(planned: int) -> None:
    before, after = [90.0, 100.0, 60.0] * 8, [60.0, 20.0, 60.0] * 8
    verdict = evaluate(
        requirements("RD under 200 ms latency >= 0.30")[0],
        agent="driver",
        clean=drives(before),
        perturbed=drives(after, setting=LATE),
        verdict_rule=VerdictRule("evidence", alpha=0.01),
        decision="inconclusive",
        planned=planned,
    )

    ended = planned == 24
    assert (verdict.low, verdict.high) == evidence_interval(before, after, 0.01, ended=ended, comparison=">=")
    assert (verdict.routes, verdict.planned) == (24, planned)


@pytest.mark.parametrize("sentence", ["DS under 200 ms latency >= 60", RD])
def test_the_interval_of_a_list_that_was_not_read_to_its_end_holds_after_the_stop(sentence: str) -> None:
    before, after = [100.0, 90.0] * 4, [0.0] * 8
    found = {
        planned: evaluate(
            requirements(sentence)[0],
            agent="driver",
            clean=drives(before),
            perturbed=drives(after, setting=LATE),
            verdict_rule=VerdictRule("list"),
            decision="fail",
            planned=planned,
        )
        for planned in (8, 19)
    }
    read, stopped = ((found[planned].low, found[planned].high) for planned in (8, 19))

    if sentence == RD:
        assert read == ratio_interval(before, after)
        assert stopped == evidence_interval(before, after, 0.025)
    else:
        assert read == (0.0, 0.0)
        assert stopped == mean_evidence_interval(after, 0.025, low=0.0, high=100.0)
    assert {verdict.p_value for verdict in found.values()} == {None}


def test_a_degradation_under_a_setting_with_a_warm_up_is_compared_with_that_warm_up_only() -> None:
    warm = "200 ms latency (mode=hold, warmup_ticks=20)"
    clean, late = drives([90.0, 80.0]), drives([80.0, 80.0], setting=str(Setting.parse(warm)))

    with pytest.raises(ComparisonError, match=r"under '0 ms latency .*', but got driver on 0 under clean"):
        evaluate(requirements(f"RD under {warm} <= 0.3")[0], agent="driver", clean=clean, perturbed=late)
    assert evaluate(requirements(f"DS under {warm} >= 60")[0], agent="driver", clean=clean, perturbed=late).passed


def test_episodes_that_do_not_belong_are_refused() -> None:
    clean, late = drives([100.0, 50.0]), drives([100.0, 50.0], setting=LATE)
    sentence = requirements(RD)[0]
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
            evaluate(sentence, **given)  # type: ignore[arg-type]


def test_a_users_metric_is_measured_with_a_jackknife_interval() -> None:
    metric = Metric.from_function("ticks", lambda results: sum(result.ticks for result in results) / len(results))
    results = [make_result(str(ticks), trace=trace_of(ticks)) for ticks in (10, 20, 60)]
    value, (low, high) = measure(metric, clean=[], perturbed=results)

    assert value == 30.0
    # mean 30, sd 26.4575, t(2; 0.975) = 4.302653
    assert (low, high) == pytest.approx((30 - 65.72, 30 + 65.72), abs=0.01)


def test_a_users_metric_that_needs_several_episodes_has_a_value_of_two_routes_and_no_interval() -> None:
    spread = Metric.from_function("spread", lambda results: statistics.stdev(result.ticks for result in results))
    results = [make_result(str(ticks), trace=trace_of(ticks)) for ticks in (100, 200)]
    value, interval = measure(spread, clean=[], perturbed=results)
    assert (value, interval) == (pytest.approx(70.7, abs=0.1), (spread.low, spread.high))


def test_a_users_metric_without_a_value_where_one_route_is_left_out_has_no_interval() -> None:
    def known_with_the_first_route(results: Sequence[EpisodeResult]) -> float | None:
        return float(len(results)) if any(result.episode.route_id == "0" for result in results) else None

    metric = Metric.from_function("known", known_with_the_first_route)
    assert measure(metric, clean=[], perturbed=drives([100.0, 50.0, 20.0])) == (3.0, (metric.low, metric.high))


@pytest.mark.parametrize("odd", ["many", 10**400])
def test_a_users_metric_that_gives_something_odd_where_one_route_is_left_out_has_no_interval(odd: object) -> None:
    def odd_of_two(results: Sequence[EpisodeResult]) -> Any:
        return 1.0 if len(results) == 3 else odd

    metric = Metric.from_function("odd", odd_of_two)
    assert measure(metric, clean=[], perturbed=drives([100.0, 50.0, 20.0])) == (1.0, (metric.low, metric.high))


@pytest.mark.parametrize("nothing", [None, math.nan, math.inf, 10**400, "much"])
def test_a_users_metric_without_a_finite_value_is_an_error(nothing: Any) -> None:
    metric = Metric.from_function("nothing", lambda results: nothing)

    with pytest.raises(ComparisonError, match="nothing"):
        measure(metric, clean=[], perturbed=[make_result()])


def test_a_value_that_nobody_read_route_by_route_promises_nothing():
    clean = [scored("1", 100.0), scored("2", 100.0)]
    wanted = requirements("DS under clean >= 60")[0]
    verdict = evaluate(wanted, agent="driver", clean=[], perturbed=clean, verdict_rule=VerdictRule())
    assert (verdict.verdict_rule.kind, verdict.decision, verdict.margin) == ("point", "pass", 0.0)


def test_the_p_value_of_routes_that_were_not_all_read_takes_no_last_look():
    wanted, rule = requirements("DS under clean >= 60")[0], VerdictRule("evidence")
    scores = [10.0 + route % 7 for route in range(40)]
    forms, values = wanted.linear_forms(rule), drives(scores)
    found = {}
    for planned in (80, 40, None):
        verdict = evaluate(
            wanted, agent="driver", clean=[], perturbed=values, verdict_rule=rule, decision="fail", planned=planned
        )
        found[planned] = verdict.p_value
    early, late = fail_p_value(forms, scores, ended=False), fail_p_value(forms, scores, ended=True)
    assert late < early
    assert found == {80: early, 40: late, None: late}


def fastest(results: Sequence[EpisodeResult]) -> float:
    return max(float(result.trace.column("speed_mps").max()) for result in results)


def at(route: str, mps: float, *, seed: int = 0, setting: str = LATE) -> EpisodeResult:
    return make_result(route, seed=seed, setting=setting, trace=trace_of(40, speed_mps=mps))


def test_a_broken_limit_of_another_metric_names_the_routes_that_break_it_alone() -> None:
    metric = Metric.from_function("fastest", fastest)
    late = [at("1", 9.0), at("2", 12.0), at("2", 14.0, seed=1), at("3", 30.0), at("4", 10.0)]
    clean = [at(result.episode.route_id, 5.0, seed=result.episode.seed, setting="clean") for result in late]
    broken = evaluate(Requirement(metric, Setting.parse(LATE), "<=", 10.0), agent="driver", clean=clean, perturbed=late)

    told = [(route.route_id, route.seed, route.perturbed_value, route.clean_value) for route in broken.worst]
    assert told == [("3", 0, 30.0, 5.0), ("2", 1, 14.0, 5.0)]
    slow = evaluate(Requirement(metric, Setting.parse(LATE), ">=", 31.0), agent="driver", clean=[], perturbed=late)
    assert [route.route_id for route in slow.worst] == ["1", "4", "2"]
    held = evaluate(Requirement(metric, Setting.parse(LATE), "<=", 30.0), agent="driver", clean=[], perturbed=late)
    assert held.worst == ()


def test_a_limit_that_holds_ranks_routes_by_the_driving_score_although_one_breaks_it_alone() -> None:
    driven = [make_result("1", speed_ratios_pct=[70.0]), scored("2", 40.0, speed_ratios_pct=[100.0])]
    verdict = evaluate(requirement("efficiency") >= 80.0, agent="driver", clean=[], perturbed=driven)
    assert verdict.passed
    assert [(route.route_id, route.perturbed_value) for route in verdict.worst] == [("2", None)]


def test_a_metric_that_is_no_number_on_some_routes_ranks_the_others() -> None:
    values = [11.0, math.nan, 30.0, math.nan, 20.0, math.nan, 40.0]
    metric = Metric.from_function(
        "bumps", lambda results: values[int(results[0].episode.route_id)] if len(results) == 1 else 25.0
    )
    late = drives([50.0] * len(values), setting=LATE)
    verdict = evaluate(Requirement(metric, Setting.parse(LATE), "<=", 10.0), agent="driver", clean=[], perturbed=late)
    assert [route.perturbed_value for route in verdict.worst] == [40.0, 30.0, 20.0]


def test_a_limit_that_no_route_breaks_alone_names_the_lowest_driving_scores_without_its_values() -> None:
    metric = Metric.from_function("together", lambda results: 3.0 * len(results))
    wanted = Requirement(metric, Setting.parse(LATE), "<=", 5.0)
    verdict = evaluate(wanted, agent="driver", clean=[], perturbed=drives([100.0, 20.0], setting=LATE))
    assert [(route.route_id, route.perturbed_value) for route in verdict.worst] == [("1", None)]


@pytest.mark.parametrize("of_one", [None, ZeroDivisionError])
def test_a_metric_without_a_value_of_one_episode_names_the_lowest_driving_scores(
    of_one: type[Exception] | None,
) -> None:
    def of_many(results: Sequence[EpisodeResult]) -> float | None:
        if len(results) > 1:
            return 1.0
        if of_one is not None:
            raise of_one
        return None

    wanted = Requirement(Metric.from_function("spread", of_many), Setting.parse(LATE), "<=", 0.5)
    verdict = evaluate(wanted, agent="driver", clean=[], perturbed=drives([100.0, 20.0, 100.0], setting=LATE))
    assert [(route.route_id, route.perturbed_value) for route in verdict.worst] == [("1", None)]
