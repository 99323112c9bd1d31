from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_factory import make_result, trace_of

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    InferenceLatency,
    Perturbation,
    Setting,
)
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.registry import registry
from pytest_drive_robust.verdict.evaluate import evaluate
from pytest_drive_robust.verdict.known_metrics import known_metric, metric_names
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.requirement import Requirement, by_evidence
from pytest_drive_robust.verdict.sentences import requirements

LATE = Setting.of(InferenceLatency(ms=200))


@given(st.sampled_from(["RD", "DS", "SR"]), st.sampled_from(["<=", ">="]), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_the_margin_is_what_the_judges_read(metric: str, comparison: str, share: float, margin: float) -> None:
    """A score at the lenient limit has no slack, and any agent can be better or worse than it."""
    top = 100.0 if metric == "DS" else 1.0
    wanted = Requirement(metric, LATE, comparison, share * top)
    rule = VerdictRule("evidence", margin=margin)
    lenient = wanted.lenient_limit(rule)
    score = 100.0 * (1.0 - lenient) if metric == "RD" else lenient
    assert wanted.linear_forms(rule).slack(score, 100.0 if metric == "RD" else 0.0) == pytest.approx(0.0, abs=1e-8)
    assert wanted.margin(rule) == pytest.approx(abs(lenient - wanted.limit))
    assert wanted.margin(rule) <= margin * top + 1e-9
    best_is_high = comparison == ">="
    assert lenient < wanted.limit if best_is_high else lenient > wanted.limit
    if metric != "RD" or comparison == "<=":
        assert 0.0 < lenient < top


def test_a_margin_that_is_not_cut_is_the_one_of_the_rule() -> None:
    assert (requirement("RD", LATE) <= 0.30).margin(VerdictRule()) == 0.1
    assert (requirement("DS") >= 60).margin(VerdictRule()) == 10.0
    assert (requirement("DS") >= 5).margin(VerdictRule()) == 2.5
    assert (requirement("efficiency") >= 60).margin(VerdictRule()) == 10.0  # no upper end: in points, as a score's


@pytest.mark.parametrize("wanted", [requirement("RD", LATE) <= 0.3, requirement("DS") >= 60, requirement("SR") >= 0.5])
def test_what_so_many_routes_can_show_is_the_same_in_the_unit_of_every_metric(wanted: Requirement) -> None:
    rule, surer = VerdictRule("evidence"), VerdictRule("evidence", alpha=0.01)

    assert [wanted.advice(rule, routes).level for routes in (19, 20, 100, 200)] == ["refuse", "warn", "warn", "fine"]
    assert wanted.advice(surer, 200).level == "warn"
    assert wanted.advice(VerdictRule("evidence", margin=0.3), 19).level == "warn"
    for kind in ("list", "point"):
        assert wanted.advice(VerdictRule(kind), 1).level == "fine"


def test_a_function_over_all_episodes_gives_no_verdict_from_evidence() -> None:
    rule, score = VerdictRule("evidence"), requirement("DS") >= 60
    ticks = Requirement(Metric.from_function("ticks", mean_ticks), LATE, "<=", 50.0)

    assert ticks.advice(rule, 1).level == "fine"
    assert [by_evidence(stated, rule) for stated in ([score, ticks], [ticks], [])] == [1, 0, 1]
    assert by_evidence([score], VerdictRule("list")) == 0
    kinds = ("evidence", "list", "point")
    assert [score.reads_routes(VerdictRule(kind)) for kind in kinds] == [True, True, False]
    assert not any(ticks.reads_routes(VerdictRule(kind)) for kind in kinds)


def test_a_margin_that_is_read_otherwise_is_still_a_margin() -> None:
    (margin,) = requirements("latency margin >= 150 ms (RD <= 0.30)")
    released = margin.read_as(DriveReading("released", "a test"))

    assert str(released) == "latency margin >= 150 ms (RD <= 0.30, reading=released)"
    assert margin.read_as(None) is margin


@pytest.mark.parametrize(
    ("sentence", "identifier"),
    [
        ("RD under 200 ms latency <= 0.30", "rd-200ms-latency-le-0.30"),
        ("SR under GPS noise 5 m >= 0.50", "sr-gps-noise-5m-ge-0.50"),
        ("RD under 3 s burst frame drop <= 0.10", "rd-3s-burst-frame-drop-le-0.10"),
        ("RD under occlusion 0.5 and 100 ms latency <= 0.40", "rd-occlusion-0.5-and-100ms-latency-le-0.40"),
        ("DS under clean >= 60", "ds-clean-ge-60"),
        ("RD under 200 ms latency (mode=hold) <= -0.05", "rd-200ms-latency-mode-hold-le-minus-0.05"),
    ],
)
def test_ids_are_readable(sentence: str, identifier: str) -> None:
    assert requirements(sentence)[0].id == identifier


def test_ids_of_different_requirements_differ_and_use_safe_characters() -> None:
    settings = [
        Setting.CLEAN,
        LATE,
        Setting.of(InferenceLatency(ms=20)),
        Setting.of(InferenceLatency(ms=200, mode="hold")),
        Setting.of(BurstFrameDrop(length_s=1)),
        Setting.of(BurstFrameDrop(length_s=1, probability=0.1)),
        BurstFrameDrop(length_s=1) + InferenceLatency(ms=200),
        InferenceLatency(ms=200) + BurstFrameDrop(length_s=1),
    ]
    made = [
        Requirement(metric, setting, comparison, limit)
        for metric in ("RD", "DS", "SR", "efficiency", "comfort")
        for setting in settings
        for comparison in ("<=", ">=")
        for limit in (0.5, 0.05, 0.505, -0.5)
        if not (metric == "RD" and setting.is_clean) and (limit > 0 or metric == "RD")
    ]

    assert len({one.id for one in made}) == len(made) == len({str(one) for one in made})
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+", one.id) for one in made)


def test_only_rd_needs_the_clean_episodes() -> None:
    assert (requirement("RD", LATE) <= 0.3).needs_clean
    assert not (requirement("DS", LATE) >= 30).needs_clean


def test_a_value_on_the_limit_meets_the_requirement() -> None:
    at_most, at_least = requirement("RD", LATE) <= 0.3, requirement("RD", LATE) >= 0.3

    assert [at_most.is_met_by(value) for value in (0.29, 0.3, 0.31)] == [True, True, False]
    assert [at_least.is_met_by(value) for value in (0.29, 0.3, 0.31)] == [False, True, True]
    assert all((requirement("RD", LATE) <= limit / 100).is_met_by(1.0 - (100 - limit) / 100) for limit in range(1, 100))
    assert not at_most.is_met_by(0.3 + 1e-6)
    score = requirement("DS") >= 60  # the rounding is a share of the range
    assert [score.is_met_by(60.0 - below) for below in (1e-8, 1e-6)] == [True, False]
    assert not at_most.is_met_by(math.nan)
    assert not at_least.is_met_by(math.nan)


@pytest.mark.parametrize(
    ("metric", "comparison", "limit", "message"),
    [
        ("RD", "<=", 1.5, "limit of RD is 1.5, expected a number in -1..1"),
        ("RD", "<=", -1.0, "expected a number above -1"),
        ("RD", "<=", 1.0, "RD <= 1 holds for every agent"),
        ("SR", ">=", 50, "limit of SR is 50, expected a number in 0..1"),
        ("SR", ">=", 0, "SR >= 0 holds for every agent"),
        ("SR", "<=", 1, "SR <= 1 holds for every agent"),
        ("DS", ">=", 101, "limit of DS is 101, expected a number in 0..100"),
        ("DS", ">=", 100.0001, "limit of DS is 100.0001, expected a number in 0..100"),
        ("DS", ">=", 0.0, "DS >= 0 holds for every agent"),
        ("comfort", ">=", -1, "expected a number in 0..100"),
        ("efficiency", ">=", -1, "expected 0 or more"),
        ("DS", ">=", math.nan, "limit of DS is nan"),
        ("DS", ">=", 10**400, "limit of DS is 10"),
        ("DS", ">=", "high", "limit of DS is 'high', expected a number"),
        ("DS", "<", 50, "'<' compares nothing. Expected '<=' or '>='"),
        ("DSS", ">=", 50, "no metric named 'DSS'. Did you mean 'DS'"),
    ],
)
def test_requirements_that_make_no_sense_are_refused(metric: str, comparison: str, limit: float, message: str) -> None:
    with pytest.raises(RequirementError, match=re.escape(message)):
        Requirement(metric, LATE, comparison, limit)


def test_the_ends_of_a_range_are_fine_where_they_can_be_missed() -> None:
    assert str(requirement("SR", LATE) >= 1) == "SR under 200 ms latency >= 1.00"
    assert str(requirement("DS", LATE) <= -0.0) == "DS under 200 ms latency <= 0"
    assert str(requirement("RD", LATE) >= 1) == "RD under 200 ms latency >= 1.00"


def test_rd_under_clean_is_refused_with_what_to_write_instead() -> None:
    with pytest.raises(RequirementError, match=r"always 0.*DS under clean >= 60"):
        requirement("RD") <= 0.3  # noqa: B015


def test_a_setting_that_is_none_is_refused() -> None:
    for state in (lambda given: requirement("RD", given), lambda given: Requirement("RD", given, "<=", 0.3)):
        with pytest.raises(RequirementError, match="'200 ms latency' is not a setting"):
            state("200 ms latency")


def test_one_perturbation_is_a_setting() -> None:
    assert Requirement("RD", InferenceLatency(ms=200), "<=", 0.3) == Requirement("RD", LATE, "<=", 0.3)


@pytest.mark.parametrize("name", [None, 3])
def test_what_is_no_name_of_a_metric_is_refused(name: object) -> None:
    for state in (requirement, lambda given: Requirement(given, LATE, "<=", 0.3)):
        with pytest.raises(RequirementError, match=rf"there is no metric named {name}\..* Expected one of RD"):
            state(name)  # type: ignore[arg-type]


def test_asserting_a_requirement_does_not_pass_for_a_verdict() -> None:
    with pytest.raises(RequirementError, match=re.escape("Judge it with drive.check(...)")):
        assert requirement("RD", LATE) <= 0.3


@dataclass
class MuddyLens(Perturbation):
    """A test's own failure."""

    grams: float = 1.0
    phrase = "muddy lens {grams} g"


def mean_ticks(results: Sequence[EpisodeResult]) -> float:
    """How long the episodes were."""
    return sum(result.ticks for result in results) / len(results)


@pytest.fixture
def own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    words = registry.Registry()
    words.register_metric("ticks", mean_ticks)
    words.register_perturbation(MuddyLens)
    for module in ("known_metrics", "sentences"):
        monkeypatch.setattr(f"pytest_drive_robust.verdict.{module}.default_registry", lambda: words)


@pytest.mark.usefixtures("own_words")
def test_registered_metrics_and_perturbations_may_be_used_in_sentences() -> None:
    sentence = "ticks under muddy lens 2 g <= 50"
    requirement = requirements(sentence)[0]
    verdict = evaluate(
        requirement,
        agent="driver",
        clean=[],
        perturbed=[make_result(setting="muddy lens 2 g", trace=trace_of(51))],
    )

    assert str(requirement) == sentence
    assert requirement.id == "ticks-muddy-lens-2-g-le-50"
    assert not requirement.needs_clean
    assert (verdict.value, verdict.passed) == (51.0, False)
    assert metric_names() == ["RD", "DS", "SR", "efficiency", "comfort", "ticks"]


@pytest.mark.usefixtures("own_words")
def test_a_typo_in_a_registered_name_is_explained_with_it() -> None:
    with pytest.raises(RequirementError, match="Nearest valid sentence: ticks under muddy lens 2 g <= 50"):
        requirements("tics under mudy lens 2 g <= 50")


def test_an_unknown_metric_is_refused_with_all_names() -> None:
    with pytest.raises(RequirementError, match=r"no metric named 'speed'.*Expected one of RD, DS, SR"):
        known_metric("speed")
