from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.evidence import degradation_forms, fail_p_value, mean_forms
from pytest_drive_robust.stats.judges import EvidenceJudge
from pytest_drive_robust.stats.multiple_verdicts import any_wrong, holm, late_fails

p_lists = st.lists(st.floats(0.0, 1.0), max_size=12)


def test_holm_by_hand() -> None:
    assert holm([0.010, 0.040, 0.030, 0.005]) == (True, False, False, True)
    assert holm([0.04]) == (True,)
    assert holm([]) == ()
    assert holm([0.025, 0.9]) == (True, False)  # alpha / 2, and no more


@given(p_lists, st.floats(0.001, 0.2))
def test_holm_rejects_between_bonferroni_and_no_correction(p_values: list[float], alpha: float) -> None:
    for p_value, rejected in zip(p_values, holm(p_values, alpha), strict=True):
        assert rejected or p_value > alpha / len(p_values)
        assert not rejected or p_value <= alpha


@given(p_lists)
def test_holm_never_keeps_a_smaller_p_value_than_it_rejects(p_values: list[float]) -> None:
    rejected = holm(p_values)

    for mine, one in zip(p_values, rejected, strict=True):
        assert all(
            other_rejected for other, other_rejected in zip(p_values, rejected, strict=True) if one and other < mine
        )


def test_what_is_no_p_value_is_refused() -> None:
    with pytest.raises(ValueError, match=r"in 0\.\.1"):
        holm([0.2, 1.5])


def test_any_wrong_grows_with_the_number_of_requirements() -> None:
    assert any_wrong(0.05, 0) == 0.0
    assert any_wrong(0.05, 1) == pytest.approx(0.05)
    assert any_wrong(0.05, 2) == pytest.approx(0.0975)


@settings(max_examples=150)
@given(st.integers(0, 10**6), st.sampled_from([10, 20, 60]), st.floats(0.2, 0.9), st.sampled_from([0.01, 0.05]))
def test_the_p_value_is_alpha_or_less_exactly_when_the_gate_fails(
    seed: int, count: int, keeps: float, alpha: float
) -> None:
    draw = random.Random(seed)
    clean = [draw.choice([100.0, 60.0, 20.0]) for _ in range(count)]
    perturbed = [before * draw.choice([1.0, keeps, draw.random()]) for before in clean]
    verdict = gate(clean, perturbed, 0.30, alpha=alpha)
    read = slice(verdict.pairs)
    ended = verdict.pairs == count
    p_value = fail_p_value(degradation_forms(0.30), perturbed[read], clean[read], ended=ended)

    assert 0.0 <= p_value <= 1.0
    assert (p_value <= alpha) == (verdict.verdict == "fail") or verdict.verdict == "pass"


def test_the_p_value_of_a_mean_and_of_nothing_to_compare_with() -> None:
    rule = mean_forms(0.6, ">=", low=0.0, high=1.0, margin=0.1)

    assert fail_p_value(rule, [0.0] * 40) < 1e-6
    assert fail_p_value(rule, [1.0] * 40) == 1.0
    assert fail_p_value(rule, []) == 1.0
    assert fail_p_value(degradation_forms(0.3), [0.0] * 40, [0.0] * 40) == 1.0


def test_p_values_are_small_as_rarely_as_they_say() -> None:
    rule, draw = mean_forms(0.6, ">=", low=0.0, high=1.0, margin=0.1), random.Random(5)
    p_values = [fail_p_value(rule, [float(draw.random() < 0.6) for _ in range(60)]) for _ in range(600)]

    for alpha in (0.05, 0.2):
        assert sum(p_value <= alpha for p_value in p_values) <= 600 * (alpha + 2 * (alpha / 600) ** 0.5)


@given(p_lists.filter(bool), st.integers(0, 5), st.floats(0.001, 0.2))
def test_what_is_red_at_once_and_what_turns_red_at_the_end_are_together_what_holm_rejects(
    p_values: list[float], unjudged: int, alpha: float
) -> None:
    family = len(p_values) + unjudged
    at_once = [p_value <= alpha / family for p_value in p_values]
    verdicts = ["fail" if red else "inconclusive" for red in at_once]
    late = late_fails(verdicts, p_values, family=family, alpha=alpha)
    together = tuple(red or place in late for place, red in enumerate(at_once))
    assert together == holm([*p_values, *([1.0] * unjudged)], alpha)[: len(p_values)]


def test_a_pass_is_never_taken_back() -> None:
    assert late_fails(["pass", "inconclusive"], [0.001, 0.03], family=2) == ()
    assert late_fails(["pass"], [0.0001], family=1) == ()


def test_what_was_not_judged_counts_in_the_family_and_what_failed_at_once_is_not_told_again() -> None:
    assert [late_fails(["inconclusive"], [0.02], family=family) for family in (2, 3)] == [(0,), ()]
    assert late_fails(["fail", "inconclusive"], [0.001, 0.04], family=2) == (1,)


@settings(max_examples=100)
@given(st.integers(0, 10**6), st.sampled_from([20, 60]), st.floats(0.2, 0.9), st.integers(2, 20))
def test_among_several_a_fail_needs_a_p_value_of_its_share_and_is_never_a_pass_instead(
    seed: int, count: int, keeps: float, family: int
) -> None:
    draw, rule = random.Random(seed), degradation_forms(0.30)
    pairs = [(before, before * draw.choice([1.0, keeps, draw.random()])) for before in [100.0, 60.0, 20.0] * count]
    alone, among = EvidenceJudge(rule), EvidenceJudge(rule, fail_alpha=0.05 / family)
    for before, after in pairs:
        alone.read(after, before)
        among.read(after, before)
    read = pairs[: among.routes]
    p_value = fail_p_value(
        rule, [after for _, after in read], [before for before, _ in read], ended=len(read) == len(pairs)
    )
    assert (among.close() == "fail") == (p_value <= 0.05 / family)
    assert alone.close() != "fail" or among.close() != "pass"
    assert among.close() != "fail" or alone.close() == "fail"
