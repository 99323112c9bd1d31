from __future__ import annotations

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.intervals import ratio_interval
from pytest_drive_robust.stats.sequential_intervals import evidence_interval, mean_evidence_interval

score = st.one_of(st.sampled_from([0.0, 60.0, 100.0]), st.floats(0.0, 100.0))
score_pairs = st.lists(st.tuples(score, score), min_size=1, max_size=40).filter(
    lambda pairs: sum(before for before, _ in pairs) > 1e-3
)


def agent(seed: int, count: int) -> tuple[list[float], list[float]]:
    draw = random.Random(seed)
    clean = [draw.choice([100.0, 100.0, 60.0, draw.uniform(0.0, 50.0)]) for _ in range(count)]
    return clean, [before * draw.choice([1.0, 0.6, draw.random()]) for before in clean]


@settings(max_examples=60)
@given(score_pairs, st.floats(0.001, 0.4), st.booleans())
def test_the_interval_of_rd_contains_it_and_is_made_of_numbers(
    pairs: list[tuple[float, float]], alpha: float, ended: bool
) -> None:
    clean, perturbed = zip(*pairs, strict=True)
    low, high = evidence_interval(clean, perturbed, alpha, ended=ended)

    assert low - 1e-9 <= 1.0 - math.fsum(perturbed) / math.fsum(clean) <= high + 1e-9
    assert high <= 1.0
    assert not math.isnan(low)


@settings(max_examples=60)
@given(score_pairs, st.randoms())
def test_less_alpha_makes_it_wider_and_the_order_makes_no_difference(
    pairs: list[tuple[float, float]], shuffle: random.Random
) -> None:
    wide = evidence_interval(*zip(*pairs, strict=True), 0.01)
    narrow = evidence_interval(*zip(*pairs, strict=True), 0.10)
    shuffle.shuffle(pairs)

    assert wide[0] <= narrow[0] <= narrow[1] <= wide[1]
    assert evidence_interval(*zip(*pairs, strict=True), 0.01) == pytest.approx(wide, rel=1e-6, abs=1e-6)


@given(st.integers(0, 10**6), st.sampled_from([30, 60, 120]), st.floats(0.2, 0.5))
@settings(max_examples=60)
def test_the_interval_agrees_with_the_verdict(seed: int, count: int, threshold: float) -> None:
    clean, perturbed = agent(seed, count)
    verdict, used = gate(clean, perturbed, threshold)
    low, high = evidence_interval(clean[:used], perturbed[:used], ended=used == count)

    if verdict == "fail":
        assert low >= threshold - 1e-9
    elif verdict == "pass":
        assert high <= threshold + 0.10 + 1e-9
    else:
        assert low <= threshold
        assert high >= threshold + 0.10


def test_it_is_wider_than_the_interval_for_a_fixed_number_of_routes_and_shrinks_with_routes() -> None:
    clean, perturbed = agent(4, 200)
    fixed, honest = ratio_interval(clean, perturbed, 0.90), evidence_interval(clean, perturbed)
    few = evidence_interval(clean[:40], perturbed[:40])

    assert honest[0] < fixed[0] < fixed[1] < honest[1]
    assert few[1] - few[0] > honest[1] - honest[0]


def test_one_pair_says_almost_nothing() -> None:
    low, high = evidence_interval([90.0], [88.0])

    assert low < -5.0
    assert high > 0.9


def test_a_perturbed_agent_that_never_moves_reaches_the_end() -> None:
    low, high = evidence_interval([90.0] * 60, [0.0] * 60)

    assert high == 1.0
    assert 0.8 < low < 1.0


@settings(max_examples=60)
@given(st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=1, max_size=60), st.booleans())
def test_the_interval_of_a_mean_contains_it_and_stays_in_its_range(values: list[float], ended: bool) -> None:
    low, high = mean_evidence_interval(values, low=0.0, high=1.0, ended=ended)

    assert 0.0 <= low <= math.fsum(values) / len(values) <= high <= 1.0
    assert low < high


def test_a_mean_without_an_upper_end_has_one_in_the_last_look_only() -> None:
    values = [80.0, 120.0, 210.0] * 20

    low, high = mean_evidence_interval(values, low=0.0, high=math.inf)
    assert 60.0 < low < 137.0
    assert high == math.inf
    low, high = mean_evidence_interval(values, low=0.0, high=math.inf, ended=True)
    assert 100.0 < low < 137.0 < high < 200.0


def test_the_ends_are_where_betting_has_just_won() -> None:
    clean, perturbed = agent(9, 50)
    low, high = evidence_interval(clean, perturbed, 0.05)

    def wealth(gains: list[float], worst: float) -> float:
        return sum(math.prod(1 + bet * gain / worst for gain in gains) for bet in (0.2, 0.5, 0.9)) / 3

    pairs = list(zip(clean, perturbed, strict=True))
    assert wealth([(1 - low) * c - p for c, p in pairs], 100.0) == pytest.approx(20.0, rel=1e-6)
    assert wealth([p - (1 - high) * c for c, p in pairs], 100.0 * (1 - high)) == pytest.approx(20.0, rel=1e-6)


def test_nothing_unpaired_values_and_values_outside_the_range_are_refused() -> None:
    with pytest.raises(ComparisonError, match="one pair or more"):
        evidence_interval([], [])
    with pytest.raises(ComparisonError, match="2 clean and 1 perturbed"):
        evidence_interval([1.0, 2.0], [1.0])
    with pytest.raises(ComparisonError, match="mean clean score is 0"):
        evidence_interval([0.0], [1.0])
    with pytest.raises(ComparisonError, match=r"in 0\.\.1"):
        mean_evidence_interval([2.0], low=0.0, high=1.0)
