"""Bisection over severities, and the bracket that it leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import PerturbationError, RequirementError
from pytest_drive_robust.metrics.table import METRICS, Metric
from pytest_drive_robust.perturbations import GpsNoise, InferenceLatency, Perturbation, SpeedNoise
from pytest_drive_robust.perturbations.ladder import Ladder, ladder_of
from pytest_drive_robust.stats.judges import judge_by
from pytest_drive_robust.verdict.largest_severity import (
    ALPHA,
    Answer,
    Bracket,
    SeverityProbe,
    bisect,
    contradictions,
    largest,
)
from pytest_drive_robust.verdict.requirement import Requirement

LATENCY = ladder_of(InferenceLatency, dt_s=0.02)


def bracket(*answers: tuple[float, Answer], ladder: Ladder = LATENCY, rule: str = "evidence") -> Bracket:
    probes = tuple(SeverityProbe(level, answer, 0.3, False, 24) for level, answer in answers)
    return Bracket(ladder, METRICS["RD"], "<=", 0.30, rule, 0.1, probes)  # type: ignore[arg-type]


@given(st.integers(0, 50))
def test_bisection_finds_the_crossing_in_six_questions_of_fifty(crossing: int) -> None:
    """The first `crossing` levels hold."""
    asked: list[float] = []

    def ask(level: float) -> SeverityProbe:
        asked.append(level)
        holds = LATENCY.levels.index(level) < crossing
        return SeverityProbe(level, "holds" if holds else "breaks", 0.0 if holds else 1.0, holds, 30)

    found = Bracket(LATENCY, METRICS["RD"], "<=", 0.30, "evidence", 0.1, bisect(LATENCY, ask))
    assert found.holds == (LATENCY.levels[crossing - 1] if crossing else None)
    assert found.breaks == (LATENCY.levels[crossing] if crossing < 50 else None)
    assert len(asked) == len(set(asked)) <= 6


def test_an_undecided_severity_sends_the_search_to_the_side_of_its_value() -> None:
    def ask(level: float) -> SeverityProbe:
        answer: Answer = "undecided" if 140 <= level <= 200 else "holds" if level < 140 else "breaks"
        return SeverityProbe(level, answer, level / 500.0, level / 500.0 <= 0.30, 30)

    found = Bracket(LATENCY, METRICS["RD"], "<=", 0.30, "evidence", 0.1, bisect(LATENCY, ask))
    assert found.undecided == (140.0, 160.0, 180.0)  # 140 meets the limit, so 160 is asked as well
    assert found.holds is not None
    assert found.holds < 140.0
    assert found.breaks is not None
    assert found.breaks > 200.0
    assert "undecided at" in found.sentence


@pytest.mark.parametrize(
    ("answers", "sentence"),
    [
        ([(140, "holds"), (160, "breaks")], "holds at 140 ms, breaks at 160 ms"),
        (
            [(140, "holds"), (180, "breaks"), (160, "undecided")],
            "holds at 140 ms, breaks at 180 ms, undecided at 160 ms",
        ),
        ([(20, "breaks")], "breaks already at 20 ms"),
        ([(20, "undecided"), (40, "breaks")], "breaks at 40 ms, undecided at 20 ms"),
        ([(1000, "holds")], "holds at 1000 ms, the most severe one tried"),
        ([(100, "holds"), (60, "breaks"), (40, "holds")], "holds at 40 ms, breaks at 60 ms"),
        ([(20, "undecided")], "undecided at 20 ms"),
    ],
)
def test_the_bracket_is_a_sentence(answers: list[tuple[float, Answer]], sentence: str) -> None:
    assert bracket(*answers).sentence == sentence


def test_the_bracket_says_by_which_rule_it_was_found() -> None:
    found = bracket((140, "holds"), (160, "breaks"))
    assert str(found) == (
        "RD <= 0.30 under latency: holds at 140 ms, breaks at 160 ms "
        "(evidence at 0.1 a side, margin 0, 24 routes a severity)"
    )
    assert "(point rule on 24 routes, too few to show more)" in str(bracket((140, "holds"), rule="point"))


def test_a_bracket_of_a_users_metric_blames_no_lack_of_routes() -> None:
    own = Metric.from_function("bumps", lambda results: 0.0)
    found = replace(bracket((140, "holds"), rule="point"), metric=own)
    assert "(point rule on 24 routes, as for all metrics of your own)" in str(found)


def test_a_bracket_compares_by_what_was_shown() -> None:
    found = bracket((140, "holds"), (160, "breaks"))
    assert found >= InferenceLatency(ms=140)
    assert found >= InferenceLatency(ms=150)  # 150 ms are 7 ticks of 20 ms, as 140 are
    assert not found >= InferenceLatency(ms=160)
    assert found < InferenceLatency(ms=160)
    assert found == InferenceLatency(ms=140)
    assert found > 100
    assert found >= bracket((100, "holds"), (120, "breaks"))


def test_what_is_undecided_is_neither_reached_nor_missed() -> None:
    found = bracket((140, "holds"), (200, "breaks"), (160, "undecided"), (180, "undecided"))
    for undecided in (160, 180):
        assert not found >= undecided
        assert not found < undecided
    assert found != 140
    assert not found <= 140
    assert found >= 140
    assert found <= 180
    assert found < 200
    other = bracket((160, "holds"), (180, "breaks"))
    assert not found >= other
    assert not found < other


def test_a_search_that_decided_nothing_compares_with_nothing() -> None:
    found = bracket(*((level, "undecided") for level in LATENCY.levels))
    for level in LATENCY.levels:
        assert not found >= level
        assert not found < level
        assert found != level


@given(st.lists(st.sampled_from(["holds", "breaks", "undecided"]), min_size=10, max_size=10), st.data())
def test_at_most_one_of_two_opposite_comparisons_is_shown(answers: list[Answer], data: st.DataObject) -> None:
    ladder = ladder_of(InferenceLatency, dt_s=0.02, levels=LATENCY.levels[:10])
    found = bracket(*zip(ladder.levels, answers, strict=True), ladder=ladder)
    level = data.draw(st.sampled_from(ladder.levels))
    assert not (found >= level and found < level)
    assert not (found > level and found <= level)
    if found >= level:
        assert found.holds is not None
        assert found.holds >= level
    if found < level:
        assert found.breaks is not None
        assert found.breaks <= level


def test_nothing_is_as_small_as_a_bracket_that_never_held() -> None:
    assert bracket((20, "breaks")) < InferenceLatency(ms=20)
    assert not bracket((20, "breaks")) >= 0


def test_a_falling_factor_is_a_rising_severity() -> None:
    found = bracket((0.5, "holds"), (0.4, "breaks"), ladder=ladder_of(SpeedNoise, dt_s=0.05))
    assert found >= SpeedNoise(mean=0.7)
    assert found < SpeedNoise(mean=0.3)
    assert found.sentence == "holds at 0.5, breaks at 0.4"


@pytest.mark.parametrize(
    ("mild", "tried", "severe"),
    [
        (SpeedNoise(mean=0.7), SpeedNoise(mean=0.5), SpeedNoise(mean=0.2)),
        (GpsNoise(std_m=3), GpsNoise(std_m=5), GpsNoise(std_m=10)),
        (InferenceLatency(ms=100), InferenceLatency(ms=140), InferenceLatency(ms=160)),
    ],
)
def test_one_level_alone_grows_the_way_of_the_usual_steps(
    mild: Perturbation, tried: Perturbation, severe: Perturbation
) -> None:
    level = ladder_of(type(tried), dt_s=0.02).level_of(tried)
    found = bracket((level, "holds"), ladder=ladder_of(type(tried), dt_s=0.02, levels=(level,)))
    assert found >= mild
    assert found == tried
    assert not found >= severe


def test_another_failure_or_other_severities_beside_it_do_not_compare() -> None:
    for other in (GpsNoise(), InferenceLatency(ms=100, mode="hold")):
        with pytest.raises(PerturbationError, match="is not on the ladder"):
            assert bracket((140, "holds")) >= other
    with pytest.raises(TypeError):
        assert bracket((140, "holds")) >= "140 ms"  # type: ignore[operator]


def probes(*values: tuple[float, float]) -> list[SeverityProbe]:
    return [SeverityProbe(level, "holds", value, True, 24) for level, value in values]


def test_a_milder_severity_that_is_clearly_worse_is_a_warning() -> None:
    (warning,) = contradictions(LATENCY, METRICS["RD"], probes((200, 0.20), (100, 0.28)))
    assert warning.startswith("not monotonic: RD 0.28 at 100 ms but 0.20 at 200 ms")
    (warning,) = contradictions(LATENCY, METRICS["DS"], probes((100, 40.0), (200, 60.0)))
    assert "DS 40.00 at 100 ms but 60.00 at 200 ms" in warning


def test_noise_is_no_contradiction() -> None:
    assert contradictions(LATENCY, METRICS["RD"], probes((100, 0.22), (200, 0.20), (300, 0.50))) == ()
    assert contradictions(LATENCY, METRICS["DS"], probes((100, 60.0), (200, 64.0), (300, 20.0))) == ()


@dataclass
class Scores:
    """A campaign whose agent loses 0.2 % of its score a millisecond, give or take; RD 0.30 is at 150 ms."""

    routes: int = 8
    noise: float = 15.0

    def __post_init__(self) -> None:
        self.rules: list[VerdictRule] = []
        self.levels: list[float] = []

    def decide(self, requirement: Requirement, verdict_rule: VerdictRule) -> SimpleNamespace:
        self.rules.append(verdict_rule)
        ms = float(requirement.setting.perturbations[0].parameters()["ms"])  # type: ignore[arg-type]
        self.levels.append(ms)
        draws = np.random.Generator(np.random.Philox(key=int(ms)))
        judge = judge_by(
            verdict_rule.kind, requirement.linear_forms(verdict_rule), planned=self.routes, alpha=verdict_rule.alpha
        )  # type: ignore[arg-type]
        scores = []
        for _ in range(self.routes):
            scores.append(float(np.clip(80.0 * (1.0 - ms / 500.0) + draws.normal(0.0, self.noise), 0.0, 100.0)))
            if judge.read(scores[-1], 80.0) is not None:
                break
        value = 1.0 - sum(scores) / (80.0 * len(scores))
        decision, routes = judge.close(), len(scores)
        return SimpleNamespace(requirement=requirement, decision=decision, value=value, routes=routes, reason="")


def test_with_enough_routes_the_bracket_rests_on_evidence_and_stops_early_far_from_the_crossing() -> None:
    campaign = Scores(220)
    found = largest(LATENCY, campaign.decide, routes=220, metric="RD", limit=0.30)  # type: ignore[arg-type]
    assert found.rule == "evidence"
    assert {(verdict_rule.kind, verdict_rule.alpha) for verdict_rule in campaign.rules} == {("evidence", ALPHA)}
    assert all(verdict_rule.margin < 1e-6 for verdict_rule in campaign.rules)
    assert found.holds in (120.0, 140.0)
    assert found.breaks in (160.0, 180.0)
    assert all(probe.routes < 80 for probe in found.probes if abs(probe.value - 0.30) > 0.15)
    assert max(probe.routes for probe in found.probes) == 220


def test_with_few_routes_values_are_compared() -> None:
    campaign = Scores(noise=0.0)
    found = largest(LATENCY, campaign.decide, routes=8, metric="RD", limit=0.30)  # type: ignore[arg-type]
    assert (found.rule, found.holds, found.breaks) == ("point", 140.0, 160.0)
    assert {verdict_rule.kind for verdict_rule in campaign.rules} == {"point"}
    assert len(campaign.levels) <= 6


@pytest.mark.parametrize(("routes", "rule"), [(19, "point"), (20, "evidence")])
def test_values_are_compared_up_to_nineteen_routes(routes: int, rule: str) -> None:
    campaign = Scores(routes)
    assert largest(LATENCY, campaign.decide, routes=routes, metric="RD", limit=0.30).rule == rule  # type: ignore[arg-type]


def test_values_of_a_users_function_are_compared_on_any_number_of_routes() -> None:
    def decide(requirement: Requirement, verdict_rule: VerdictRule) -> SimpleNamespace:
        return SimpleNamespace(requirement=requirement, decision="pass", value=3.0, routes=30, reason="")

    found = largest(LATENCY, decide, routes=30, metric=Metric.from_function("episodes", len), limit=2.0)  # type: ignore[arg-type]
    assert (found.rule, found.holds) == ("point", 1000.0)


def test_the_comparison_follows_the_metric() -> None:
    found = largest(LATENCY, Scores(noise=0.0).decide, routes=8, metric="RD", limit=0.30, comparison=">=")  # type: ignore[arg-type]
    assert found.comparison == ">="
    assert largest(LATENCY, Scores().decide, routes=8, metric="RD", limit=0.30).comparison == "<="  # type: ignore[arg-type]


def test_levels_that_begin_with_the_most_severe_are_refused_before_anything_is_driven() -> None:
    campaign = Scores()
    for failure, levels, way in ((InferenceLatency, (300.0, 100.0), "up"), (SpeedNoise, (0.2, 0.5), "down")):
        ladder = ladder_of(failure, dt_s=0.02, levels=levels)
        with pytest.raises(PerturbationError, match=rf"lead from .* expected from mild to severe: {way}, as its own"):
            largest(ladder, campaign.decide, routes=8, metric="RD", limit=0.30)  # type: ignore[arg-type]
    assert campaign.levels == []


def test_a_limit_that_no_agent_can_miss_is_refused_before_anything_is_driven() -> None:
    campaign = Scores()
    with pytest.raises(RequirementError, match="holds for every agent"):
        largest(LATENCY, campaign.decide, routes=8, metric="RD", limit=1.0)  # type: ignore[arg-type]
    assert campaign.levels == []


@pytest.mark.parametrize("metric", ["DSS", None, 5])
def test_what_is_no_metric_is_refused_before_anything_is_driven(metric: Any) -> None:
    campaign = Scores()
    with pytest.raises(RequirementError, match=f"there is no metric named {metric!r}"):
        largest(LATENCY, campaign.decide, routes=8, metric=metric, limit=0.3)  # type: ignore[arg-type]
    assert campaign.levels == []
