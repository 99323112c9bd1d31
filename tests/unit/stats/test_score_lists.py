from __future__ import annotations

import math
import random
import subprocess
import sys
from collections.abc import Iterator
from statistics import fmean

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats import GateVerdict, gate

scores = st.one_of(st.sampled_from([0.0, 60.0, 100.0]), st.floats(0.0, 100.0))
gate_pairs = st.lists(st.tuples(scores, scores), min_size=1, max_size=80)


def reference(
    clean: list[float], perturbed: list[float], threshold: float, margin: float, alpha: float
) -> tuple[str, int]:
    """The rule written out plainly, in logarithms and with all pairs at hand."""
    from scipy.special import stdtr

    def log_wealth(xs: list[float], bound: float) -> Iterator[float]:
        logs = [0.0, 0.0, 0.0]
        for x in xs:
            logs = [log + math.log1p(bet / bound * x) for log, bet in zip(logs, (0.2, 0.5, 0.9), strict=True)]
            yield max(logs) + math.log(fmean([math.exp(log - max(logs)) for log in logs]))

    def p_mean_below_zero(values: list[float], short: float = 0.0) -> float:
        values = [value + short for value in values]
        count, mean = len(values), fmean(values)
        spread = math.sqrt(fmean([(value - mean) ** 2 for value in values]))
        u = mean / max(spread * math.sqrt(count / (count - 1)), 1e-9 * max(abs(mean), 1e-9))
        u = max(-1e6, min(1e6, u))
        g = fmean([(value - mean) ** 3 for value in values]) / max(spread, 1e-6) ** 3
        return float(stdtr(count - 1, (u + g * u**2 / 3 + g**2 * u**3 / 27 + g / (6 * count)) * math.sqrt(count)))

    keep, allow = 1 - threshold, 1 - threshold - margin
    hold = [after - keep * before for before, after in zip(clean, perturbed, strict=True)]
    slack = [after - allow * before for before, after in zip(clean, perturbed, strict=True)]
    need = -math.log(alpha / 5)
    sides = zip(log_wealth([-x / 100 for x in hold], 1.0), log_wealth([x / 100 for x in slack], allow), strict=True)
    for count, (against, within) in enumerate(sides, 1):
        if against >= need:
            return "fail", count
        if within >= need:
            return "pass", count
    if len(hold) >= 20:
        mean = fmean(hold)
        error = math.sqrt(fmean([(value - mean) ** 2 for value in hold]) / (len(hold) - 1))
        unseen = (100.0 / (100.0 + max(0.0, 3.0 * error - mean))) ** len(hold)
        for step in range(-8, 6):
            short = max(0.0, 0.5 * step * error - mean)
            unseen = max(unseen, p_mean_below_zero(hold, short) * (100.0 / (100.0 + short)) ** len(hold))
        if unseen <= alpha and p_mean_below_zero(hold) <= 0.8 * alpha:
            return "fail", len(hold)
        if 1 - p_mean_below_zero([*slack, -100.0 * allow]) <= 0.8 * alpha:
            return "pass", len(hold)
    return "inconclusive", len(hold)


@settings(max_examples=300)
@given(
    gate_pairs.filter(lambda pairs: pairs[0][0] > 0.0),
    st.floats(0.0, 0.97),
    st.floats(0.02, 0.25),
    st.sampled_from([0.01, 0.05, 0.1]),
)
def test_the_gate_equals_the_rule_written_out(
    pairs: list[tuple[float, float]], threshold: float, margin: float, alpha: float
) -> None:
    assume(threshold + margin < 0.99)  # beyond, the margin is cut
    clean, perturbed = map(list, zip(*pairs, strict=True))

    assert gate(clean, perturbed, threshold, margin, alpha) == reference(clean, perturbed, threshold, margin, alpha)


@given(st.integers(0, 10**6), st.sampled_from([20, 60, 220]), st.floats(0.1, 0.6))
def test_the_gate_equals_the_rule_written_out_on_scores_as_agents_get_them(seed: int, count: int, loss: float) -> None:

    draw = random.Random(seed)
    clean = [draw.choice([100.0, 100.0, 60.0, draw.uniform(0.0, 50.0)]) for _ in range(count)]
    perturbed = [before * draw.choice([1.0, 1.0 - loss, draw.random()]) for before in clean]

    assert gate(clean, perturbed, 0.30, 0.10, 0.05) == reference(clean, perturbed, 0.30, 0.10, 0.05)


@given(gate_pairs, st.floats(-0.2, 0.9))
def test_the_same_scores_give_the_same_verdict(pairs: list[tuple[float, float]], threshold: float) -> None:
    clean, perturbed = zip(*pairs, strict=True)

    assert gate(clean, perturbed, threshold) == gate(list(clean), list(perturbed), threshold)


@given(gate_pairs, gate_pairs)
def test_pairs_after_the_stop_do_not_matter(
    pairs: list[tuple[float, float]], others: list[tuple[float, float]]
) -> None:
    pairs = [*pairs, *[(90.0, 85.0)] * 40]
    first = gate(*zip(*pairs, strict=True), threshold=0.30)
    kept = pairs[: first.pairs]

    if first.pairs < len(pairs):
        assert gate(*zip(*kept, *others, strict=True), threshold=0.30) == first
        assert gate(*zip(*kept, strict=True), threshold=0.30) == first


@pytest.mark.parametrize("count", [20, 50, 100, 220])
@pytest.mark.parametrize("score", [60.0, 80.0, 100.0])
def test_identical_runs_pass(count: int, score: float) -> None:
    assert gate([score] * count, [score] * count, threshold=0.30).verdict == "pass"


@given(st.lists(scores, min_size=20, max_size=60))
def test_identical_runs_never_fail_however_bad_they_are(clean: list[float]) -> None:
    assert gate(clean, clean, threshold=0.30).verdict != "fail"


def test_a_perturbed_agent_that_never_moves_fails() -> None:
    assert gate([80.0] * 60, [0.0] * 60, threshold=0.30).verdict == "fail"


def test_a_clean_agent_that_never_moves_is_inconclusive_whatever_the_perturbed_one_does() -> None:
    assert gate([0.0] * 50, [0.0] * 50, threshold=0.30) == GateVerdict("inconclusive", 50)
    assert gate([0.0] * 50, [100.0] * 50, threshold=0.30) == GateVerdict("inconclusive", 50)


def test_three_pairs_decide_nothing() -> None:
    assert gate([100.0] * 3, [100.0] * 3, threshold=0.30).verdict == "inconclusive"
    assert gate([100.0] * 3, [0.0] * 3, threshold=0.30).verdict == "inconclusive"


@pytest.mark.parametrize(("clean", "perturbed"), [(80.0, 56.0), (90.0, 63.0), (30.0, 21.0), (7.3, 7.3 * 0.7)])
def test_scores_without_spread_exactly_at_the_threshold_do_not_fail_by_rounding(clean: float, perturbed: float) -> None:
    assert gate([clean] * 220, [perturbed] * 220, threshold=0.30).verdict != "fail"


def test_a_margin_that_reaches_rd_1_is_cut_to_half_the_way() -> None:
    assert gate([100.0] * 100, [1.0] * 100, threshold=0.95, margin=0.10).verdict == "fail"
    assert gate([100.0] * 400, [40.0] * 400, threshold=0.95, margin=0.10).verdict == "pass"


def test_a_margin_that_reaches_rd_1_but_for_rounding_is_cut_too() -> None:
    assert 1.0 - 0.7 > 0.3
    assert gate([100.0] * 3, [1.0] * 3, threshold=0.7, margin=0.3).verdict == "inconclusive"


def test_arrays_and_generators_are_read_like_lists() -> None:
    import numpy as np

    clean, perturbed = np.full(30, 90.0), np.full(30, 88.0)

    assert gate(clean, perturbed, 0.30) == gate((90.0 for _ in range(30)), (88.0 for _ in range(30)), 0.30)


def test_scores_that_cannot_be_and_lists_that_do_not_pair_are_refused() -> None:
    for wrong in (-1.0, 100.1, math.nan, math.inf):
        with pytest.raises(ComparisonError, match=r"expected a number in 0\.\.100"):
            gate([90.0, 90.0], [90.0, wrong], 0.30)
    with pytest.raises(ComparisonError, match="do not pair"):
        gate([90.0, 90.0], [90.0], 0.30)
    with pytest.raises(ComparisonError, match="no pair"):
        gate([], [], 0.30)


def test_what_stands_behind_the_stop_is_refused_as_well() -> None:
    assert gate([90.0] * 30, [88.0] * 30, 0.30).pairs < 20
    with pytest.raises(ComparisonError, match="do not pair"):
        gate([90.0] * 30, [88.0] * 20, 0.30)
    with pytest.raises(ComparisonError, match=r"expected a number in 0\.\.100"):
        gate([90.0] * 30, [88.0] * 29 + [880.0], 0.30)


@pytest.mark.parametrize(("threshold", "margin", "alpha"), [(1.0, 0.1, 0.05), (0.3, 0.0, 0.05), (0.3, 0.1, 0.5)])
def test_a_threshold_margin_or_alpha_that_leaves_nothing_to_decide_is_refused(
    threshold: float, margin: float, alpha: float
) -> None:
    with pytest.raises(ValueError, match="expected"):
        gate([90.0], [90.0], threshold, margin, alpha)


@pytest.mark.parametrize("order", ["import pytest_drive_robust.stats.score_lists", "pass"])
def test_the_gate_is_a_function_of_the_package_and_importing_it_costs_nothing(order: str) -> None:
    code = (
        f"import sys\n{order}\nfrom pytest_drive_robust import stats\nfrom pytest_drive_robust.stats import gate\n"
        "from pytest_drive_robust.stats.score_lists import gate as same\n"
        "assert stats.gate is gate is same and gate([90.0] * 30, [88.0] * 30, 0.30).verdict == 'pass'\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'scipy', 'numpy', 'pytest', 'numba'}))"
    )

    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert shown.stdout.strip() == "[]"


def test_the_last_look_needs_no_scipy() -> None:
    code = (
        "import sys\nfrom pytest_drive_robust.stats import gate\ngate([50.0, 90.0] * 15, [30.0, 80.0] * 15, 0.30)\n"
        "print('scipy' in sys.modules)"
    )

    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert shown.stdout.split() == ["False"]
