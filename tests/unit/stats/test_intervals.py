from __future__ import annotations

import math
import random
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.evidence import LinearForms, degradation_forms, mean_forms
from pytest_drive_robust.stats.intervals import (
    evidence_interval,
    jackknife_interval,
    mean_evidence_interval,
    mean_interval,
    ratio_interval,
    share_interval,
)
from pytest_drive_robust.stats.judges import EvidenceJudge

value_lists = st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30)
score_pairs = st.lists(st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 100.0)), min_size=1, max_size=30).filter(
    lambda pairs: sum(before for before, _ in pairs) > 1e-3
)


def width(interval: tuple[float, float]) -> float:
    return interval[1] - interval[0]


def test_the_t_interval_of_three_numbers_by_hand() -> None:
    # mean 4, sd 2, t(2; 0.975) = 4.302653
    low, high = mean_interval([2.0, 4.0, 6.0])

    assert (low, high) == pytest.approx((4 - 4.302653 * 2 / math.sqrt(3), 4 + 4.302653 * 2 / math.sqrt(3)), abs=1e-5)


def test_wilson_of_24_successes_in_24_by_hand() -> None:
    # n / (n + z^2) = 24 / 27.8415
    assert share_interval([1.0] * 24) == (pytest.approx(0.862025, abs=1e-5), 1.0)
    assert share_interval([0.0] * 24) == (0.0, pytest.approx(0.137975, abs=1e-5))


def test_fieller_without_spread_in_the_clean_scores_is_the_t_interval() -> None:
    perturbed = [30.0, 50.0, 70.0]
    low, high = mean_interval(perturbed)

    assert ratio_interval([100.0] * 3, perturbed) == pytest.approx((1.0 - high / 100.0, 1.0 - low / 100.0))


@settings(max_examples=60)
@given(score_pairs)
def test_fieller_inverts_the_paired_t_test(pairs: list[tuple[float, float]]) -> None:
    from scipy.special import stdtrit

    clean, perturbed = np.array(pairs).T
    low, high = ratio_interval(list(clean), list(perturbed))
    for threshold in (low, high):
        if not math.isfinite(threshold) or threshold == 1.0 or len(pairs) < 2:
            continue
        difference = perturbed - (1.0 - threshold) * clean
        allowed = stdtrit(len(pairs) - 1, 0.975) * difference.std(ddof=1) / math.sqrt(len(pairs))
        assert abs(difference.mean()) == pytest.approx(allowed, rel=1e-6, abs=1e-6)


@given(value_lists)
def test_the_interval_of_a_mean_contains_it(values: list[float]) -> None:
    low, high = mean_interval(values, bounds=(0.0, 100.0))

    assert 0.0 <= low <= math.fsum(values) / len(values) <= high <= 100.0


@given(st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=1, max_size=30))
def test_the_interval_of_a_share_contains_it_and_is_never_a_point(values: list[float]) -> None:
    low, high = share_interval(values)

    assert 0.0 <= low <= sum(values) / len(values) <= high <= 1.0
    assert low < high


@given(score_pairs)
def test_the_interval_of_rd_contains_it(pairs: list[tuple[float, float]]) -> None:
    clean, perturbed = zip(*pairs, strict=True)
    low, high = ratio_interval(clean, perturbed)

    assert low <= 1.0 - (math.fsum(perturbed) / len(pairs)) / (math.fsum(clean) / len(pairs)) <= high <= 1.0


@given(score_pairs.filter(lambda pairs: len(pairs) > 1), st.randoms())
def test_the_interval_of_rd_does_not_depend_on_the_order(pairs: list, random: object) -> None:
    shuffled = list(pairs)
    random.shuffle(shuffled)  # type: ignore[attr-defined]

    assert ratio_interval(*zip(*pairs, strict=True)) == ratio_interval(*zip(*shuffled, strict=True))


@pytest.mark.parametrize("interval", [mean_interval, share_interval])
def test_more_routes_make_it_narrower(interval: Callable) -> None:
    values = [0.1, 0.9, 0.4, 1.0, 0.0]

    assert width(interval(values * 4)) < width(interval(values))


def test_more_routes_make_the_interval_of_rd_narrower() -> None:
    clean, perturbed = [90.0, 100.0, 60.0, 80.0], [60.0, 90.0, 10.0, 80.0]

    assert width(ratio_interval(clean * 4, perturbed * 4)) < width(ratio_interval(clean, perturbed))


def test_less_confidence_makes_it_narrower() -> None:
    without = [0.5, 0.6, 0.4, 0.5]

    assert width(jackknife_interval(0.5, without, 0.8)) < width(jackknife_interval(0.5, without))


def test_identical_runs_have_an_rd_of_exactly_0() -> None:
    clean = [12.3, 100.0, 45.6]

    assert ratio_interval(clean, clean) == (0.0, 0.0)


def test_one_route_says_nothing_about_the_spread() -> None:
    assert mean_interval([5.0]) == (-math.inf, math.inf)
    assert mean_interval([5.0], bounds=(0.0, 100.0)) == (0.0, 100.0)
    assert ratio_interval([80.0], [40.0]) == (-math.inf, 1.0)
    assert jackknife_interval(5.0, [0.0]) == (-math.inf, math.inf)


def test_a_clean_mean_that_may_be_0_leaves_rd_open() -> None:
    assert ratio_interval([0.0, 0.0, 100.0], [0.0, 0.0, 50.0]) == (-math.inf, 1.0)


def test_nothing_unpaired_lists_and_a_clean_mean_of_0_are_refused() -> None:
    for interval in (mean_interval, share_interval):
        with pytest.raises(ComparisonError, match="no value"):
            interval([])
    with pytest.raises(ComparisonError, match="2 clean and 1 perturbed"):
        ratio_interval([1.0, 2.0], [1.0])
    with pytest.raises(ComparisonError, match="mean clean score is 0"):
        ratio_interval([0.0, 0.0], [1.0, 2.0])
    with pytest.raises(ValueError, match="expected a number between 0 and 1"):
        jackknife_interval(1.5, [2.0, 1.0], 95.0)


@given(value_lists.filter(lambda values: len(values) > 1))
def test_the_jackknife_of_a_mean_is_the_t_interval(values: list[float]) -> None:
    total = math.fsum(values)
    without = [(total - value) / (len(values) - 1) for value in values]

    assert jackknife_interval(total / len(values), without) == pytest.approx(mean_interval(values), abs=1e-6)


def routes(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Clean and perturbed scores as they look: many at 100, the rest anywhere; a lost route loses a random share."""
    clean = np.where(rng.random(count) < 0.6, 100.0, rng.uniform(0.0, 80.0, count))
    lost = np.where(rng.random(count) < 0.5, rng.uniform(0.0, 1.0, count), 0.0)
    return clean, clean * (1.0 - lost)


def test_the_interval_of_rd_is_close_to_a_paired_bootstrap() -> None:
    rng = np.random.default_rng(5)
    clean, perturbed = routes(rng, 200)
    draws = rng.integers(0, 200, (4000, 200))
    resampled = 1.0 - perturbed[draws].mean(axis=1) / clean[draws].mean(axis=1)

    assert ratio_interval(list(clean), list(perturbed)) == pytest.approx(
        tuple(np.quantile(resampled, [0.025, 0.975])), abs=0.01
    )


def test_the_interval_of_rd_covers_the_truth_about_95_times_in_100() -> None:
    rng = np.random.default_rng(11)
    truth = 0.25  # half of the routes lose half of their score on average, independent of the clean score
    intervals = [ratio_interval(*map(list, routes(rng, 50))) for _ in range(1000)]
    covered = sum(low <= truth <= high for low, high in intervals) / len(intervals)

    assert 0.93 <= covered <= 0.97


def test_the_interval_of_a_mean_covers_the_truth_about_95_times_in_100() -> None:
    rng = np.random.default_rng(12)
    intervals = [mean_interval(list(routes(rng, 50)[0])) for _ in range(1000)]
    covered = sum(low <= 0.6 * 100.0 + 0.4 * 40.0 <= high for low, high in intervals) / len(intervals)

    assert 0.93 <= covered <= 0.97


score = st.one_of(st.sampled_from([0.0, 60.0, 100.0]), st.floats(0.0, 100.0))
scored_pairs = st.lists(st.tuples(score, score), min_size=1, max_size=40).filter(
    lambda pairs: sum(before for before, _ in pairs) > 1e-3
)


def agent(seed: int, count: int) -> tuple[list[float], list[float]]:
    draw = random.Random(seed)
    clean = [draw.choice([100.0, 100.0, 60.0, draw.uniform(0.0, 50.0)]) for _ in range(count)]
    return clean, [before * draw.choice([1.0, 0.6, draw.random()]) for before in clean]


@settings(max_examples=60)
@given(scored_pairs, st.floats(0.001, 0.4), st.booleans())
def test_the_interval_of_rd_contains_it_and_is_made_of_numbers(
    pairs: list[tuple[float, float]], alpha: float, ended: bool
) -> None:
    clean, perturbed = zip(*pairs, strict=True)
    low, high = evidence_interval(clean, perturbed, alpha, ended=ended)

    assert low - 1e-9 <= 1.0 - math.fsum(perturbed) / math.fsum(clean) <= high + 1e-9
    assert high <= 1.0
    assert not math.isnan(low)


@settings(max_examples=60)
@given(scored_pairs, st.randoms())
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
    fixed, honest = ratio_interval(clean, perturbed), evidence_interval(clean, perturbed)
    few = evidence_interval(clean[:40], perturbed[:40])

    assert honest[0] < fixed[0] < fixed[1] < honest[1]
    assert few[1] - few[0] > honest[1] - honest[0]


def test_one_pair_says_almost_nothing() -> None:
    low, high = evidence_interval([90.0], [88.0])

    assert low < -5.0
    assert high > 0.9
    assert -40_000.0 < evidence_interval([0.1], [0.1])[0] < -30_000.0  # a clean score that may gain very much


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


SHAPES = {
    "all or nothing": lambda draw, at: (100.0, 100.0 * (draw.random() < at)),
    "all the same": lambda draw, at: (80.0, 80.0 * at),
    "spread": lambda draw, at: (draw.choice([100.0, 60.0, 20.0]), 100.0 * min(1.0, at * 2.0 * draw.random())),
    "rare": lambda draw, at: (100.0, 100.0 * at if draw.random() < 0.95 else draw.choice([0.0, 100.0])),
}


def decided(forms: LinearForms, rows: list[tuple[float, float]]) -> tuple[str, int]:
    judge = EvidenceJudge(forms)
    for reference, score in rows:
        if judge.read(score, reference) is not None:
            break
    return judge.close(), judge.routes


shapes = st.sampled_from(sorted(SHAPES))
comparisons = st.sampled_from(["<=", ">="])


@settings(max_examples=300)
@given(shapes, comparisons, st.integers(0, 10**6), st.integers(20, 60), st.floats(0.02, 0.98), st.floats(0.02, 0.85))
def test_the_interval_of_rd_never_contradicts_the_verdict(
    shape: str, comparison: str, seed: int, count: int, at: float, limit: float
) -> None:
    draw = random.Random(seed)
    rows = [SHAPES[shape](draw, at) for _ in range(count)]
    decision, used = decided(degradation_forms(limit, 0.10, comparison=comparison), rows)
    clean, perturbed = zip(*rows[:used], strict=True)
    low, high = evidence_interval(clean, perturbed, ended=used == count, comparison=comparison)
    assert_agrees(decision, comparison, limit, 0.10, low, high)


@settings(max_examples=300)
@given(shapes, comparisons, st.integers(0, 10**6), st.integers(20, 60), st.floats(0.02, 0.98), st.floats(0.02, 0.98))
def test_the_interval_of_a_mean_never_contradicts_the_verdict(
    shape: str, comparison: str, seed: int, count: int, at: float, limit: float
) -> None:
    draw = random.Random(seed)
    rows = [(0.0, SHAPES[shape](draw, at)[1] / 100.0) for _ in range(count)]
    decision, used = decided(mean_forms(limit, comparison, margin=0.10, low=0.0, high=1.0), rows)
    values = [value for _, value in rows[:used]]
    low, high = mean_evidence_interval(values, low=0.0, high=1.0, ended=used == count, comparison=comparison)
    assert_agrees(decision, comparison, limit, 0.10, low, high)


def assert_agrees(decision: str, comparison: str, limit: float, margin: float, low: float, high: float) -> None:
    """A fail's interval excludes the limit, a pass's the limit and the margin."""
    rounding = 1e-9
    if decision == "fail":
        assert low >= limit - rounding if comparison == "<=" else high <= limit + rounding
    elif decision == "pass":
        lenient = limit + margin if comparison == "<=" else limit - margin
        assert high <= lenient + rounding if comparison == "<=" else low >= lenient - rounding


@pytest.mark.parametrize("routes", [20, 44, 100])
def test_routes_that_all_score_nothing_leave_room_for_those_that_nobody_drew(routes: int) -> None:
    low, high = evidence_interval([100.0] * routes, [0.0] * routes, ended=True)
    assert high == 1.0
    assert (1.0 / (2.0 - low)) ** routes == pytest.approx(0.05, rel=1e-6)  # none of those that score 100


@pytest.mark.parametrize(("routes", "share"), [(20, 0.05), (44, 0.02), (100, 0.02)])
def test_rare_successes_seldom_leave_the_interval(routes: int, share: float) -> None:
    draw, missed = random.Random(5), 0
    for _ in range(120):
        perturbed = [100.0 * (draw.random() < share) for _ in range(routes)]
        low, high = evidence_interval([100.0] * routes, perturbed, ended=True)
        missed += not low - 1e-9 <= 1.0 - share <= high + 1e-9
    assert missed <= 0.05 * 120


def test_a_share_stays_within_0_and_1_where_rounding_would_leave_them():
    for count in range(1, 100):
        assert share_interval([1.0] * count)[1] == 1.0  # 9 of 9 would be 1.0000000000000002, 13 of 13 below 1
        assert share_interval([0.0] * count)[0] == 0.0


def test_betting_at_the_last_look_spends_its_share_of_the_error_alone():
    few = [100.0] * 10
    early, ended = (mean_evidence_interval(few, low=0.0, high=100.0, ended=ended)[0] for ended in (False, True))
    assert ended < early
