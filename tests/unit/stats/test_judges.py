from __future__ import annotations

import math
import random
import subprocess
import sys
from collections.abc import Iterator, Sequence
from statistics import fmean

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats import GateVerdict, gate
from pytest_drive_robust.stats.evidence import LinearForms, degradation_forms, fail_p_value, mean_forms
from pytest_drive_robust.stats.judges import EvidenceJudge, Judge, ListJudge, PointJudge, judge_by, read_until_decided

RULE = degradation_forms(0.30)
score = st.one_of(st.sampled_from([0.0, 60.0, 100.0]), st.floats(0.0, 100.0))
score_pairs = st.lists(st.tuples(score, score), min_size=1, max_size=60)


def read(judge: Judge, pairs: Sequence[tuple[float, float]]) -> tuple[str, int]:
    for clean, perturbed in pairs:
        if judge.read(perturbed, clean) is not None:
            break
    return judge.close(), judge.routes


def agent(seed: int, count: int, keeps: float) -> list[tuple[float, float]]:
    draw = random.Random(seed)
    clean = [draw.choice([100.0, 100.0, 60.0, 20.0]) for _ in range(count)]
    return [(before, before * draw.choice([1.0, keeps, keeps * draw.random()])) for before in clean]


@pytest.mark.parametrize("kind", ["evidence", "list"])
def test_no_route_is_taken_after_the_verdict_and_those_without_data_are_counted_but_not_read(kind) -> None:
    taken = []

    def scores():
        for number in range(60):
            taken.append(number)
            yield None if number % 3 == 0 else (90.0, 90.0)

    decision, count = read_until_decided(judge_by(kind, RULE, planned=60), scores())
    judge = judge_by(kind, RULE, planned=60)
    reads = 0
    while judge.read(90.0, 90.0) is None:
        reads += 1

    assert (decision, count) == ("pass", len(taken))
    assert reads + 1 == sum(number % 3 != 0 for number in taken)


@pytest.mark.parametrize("kind", ["evidence", "list"])
@pytest.mark.parametrize("keeps", [0.95, 0.8, 0.2])
def test_how_many_routes_are_likely_left_is_never_absurd_and_soon_right(kind: str, keeps: float) -> None:
    pairs = agent(3, 60, keeps)
    taken = read(judge_by(kind, RULE, planned=60), pairs)[1]  # type: ignore[arg-type]
    judge = judge_by(kind, RULE, planned=60)  # type: ignore[arg-type]
    for number, (clean, perturbed) in enumerate(pairs[:taken]):
        left = judge.likely_left(60)
        assert 1 <= left <= 60 - number
        if number >= taken // 2:
            assert number + left <= 2 * taken
        judge.read(perturbed, clean)
    assert judge.likely_left(60) == 0


def test_a_comparison_of_all_values_reads_all_routes() -> None:
    judge = PointJudge(RULE)
    assert judge.likely_left(60) == 60
    judge.read(90.0, 90.0)
    assert judge.likely_left(60) == 59


def test_a_metric_without_a_lower_end_has_no_early_pass_to_wait_for() -> None:
    forms = mean_forms(60.0, "<=", margin=10.0, low=0.0)  # efficiency
    assert judge_by("evidence", forms, planned=60).likely_left(60) == 60


def test_a_list_that_turns_out_shorter_is_judged_by_its_value() -> None:
    scores = [(90.0, 90.0), None, (70.0, 90.0)]

    assert read_until_decided(ListJudge(RULE, planned=3), scores) == ("pass", 3)
    assert read_until_decided(ListJudge(degradation_forms(0.10), planned=3), scores) == ("fail", 3)
    with pytest.raises(ComparisonError, match="no pair"):
        read_until_decided(ListJudge(RULE, planned=2), [None, None])


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
def test_every_judge_fails_a_crash_passes_a_twin_and_finds_nothing_to_compare_with_zeros(kind: str) -> None:
    def verdict(clean: float, perturbed: float) -> str:
        return read(judge_by(kind, RULE, planned=60), [(clean, perturbed)] * 60)[0]  # type: ignore[arg-type]

    assert verdict(90.0, 10.0) == "fail"
    assert verdict(90.0, 90.0) == "pass"
    assert verdict(0.0, 0.0) == "inconclusive"
    assert verdict(0.0, 50.0) == "inconclusive"


@given(score_pairs.filter(lambda pairs: any(clean > 0.0 for clean, _ in pairs)))
def test_the_point_judge_reads_everything_and_compares(pairs: list[tuple[float, float]]) -> None:
    verdict, routes = read(PointJudge(RULE), pairs)
    excess = sum(perturbed - 0.7 * clean for clean, perturbed in pairs)

    assert routes == len(pairs)
    if abs(excess) > 1e-3:
        assert verdict == ("pass" if excess > 0.0 else "fail")


def test_equal_to_the_limit_passes_by_point_and_by_list() -> None:
    pairs = [(80.0, 56.0)] * 30

    assert read(PointJudge(RULE), pairs) == ("pass", 30)
    assert read(ListJudge(RULE, planned=30), pairs)[0] == "pass"


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.floats(0.2, 0.9))
def test_a_list_that_was_read_to_the_end_is_judged_like_the_point(seed: int, keeps: float) -> None:
    pairs = agent(seed, 25, keeps)
    verdict, routes = read(ListJudge(RULE, planned=25, alpha=1e-9), pairs)

    assert verdict == read(PointJudge(RULE), pairs)[0]
    assert routes <= 25


@settings(max_examples=100)
@given(score_pairs.filter(lambda pairs: any(clean > 0.0 for clean, _ in pairs)))
def test_a_list_stops_on_certainty_only_where_it_may_not_err(pairs: list[tuple[float, float]]) -> None:
    # alpha so small that no bet can be won within 60 routes: what stops is what the routes left cannot turn
    verdict, _ = read(ListJudge(RULE, planned=len(pairs), alpha=1e-30), pairs)

    assert verdict == read(PointJudge(RULE), pairs)[0]


def test_a_list_stops_when_the_routes_left_cannot_turn_it() -> None:
    rule = mean_forms(0.5, ">=", low=0.0, high=1.0, margin=0.1)
    judge = ListJudge(rule, planned=10, alpha=0.001)
    verdicts = [judge.read(0.0) for _ in range(6)]

    assert verdicts == [None] * 5 + ["fail"]


@pytest.mark.parametrize("limit", [0.25, 0.30, 0.35])
def test_a_list_disagrees_with_the_full_list_at_most_alpha_of_the_shuffles(limit: float) -> None:
    pairs = agent(3, 120, 0.62)
    rule = degradation_forms(limit)
    truth = read(PointJudge(rule), pairs)[0]
    wrong, used, shuffles = 0, 0, 300
    for seed in range(shuffles):
        shuffled = random.Random(seed).sample(pairs, len(pairs))
        verdict, routes = read(ListJudge(rule, planned=120), shuffled)
        wrong += verdict != truth
        used += routes

    assert wrong <= 0.05 * shuffles
    assert used < 120 * shuffles


def test_a_list_that_ends_before_its_end_is_inconclusive_and_one_route_more_is_refused() -> None:
    judge = ListJudge(RULE, planned=20)
    judge.read(70.0, 100.0)
    assert judge.close() == "inconclusive"

    judge = ListJudge(RULE, planned=1)
    with pytest.raises(ComparisonError, match="no pair"):
        judge.close()
    assert judge.read(70.0, 100.0) == "pass"
    assert judge.read(0.0, 100.0) == "pass"


def test_a_list_without_a_range_bets_nothing_and_is_read_to_the_end() -> None:
    rule = mean_forms(60.0, ">=", margin=5.0)

    assert read(ListJudge(rule, planned=40), [(0.0, 100.0), (0.0, 30.0)] * 20) == ("pass", 40)


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
@pytest.mark.parametrize("wrong", [float("nan"), 300.0, -300.0])
def test_a_score_that_cannot_be_is_refused(kind: str, wrong: float) -> None:
    with pytest.raises(ComparisonError, match="outside"):
        judge_by(kind, RULE, planned=5).read(wrong, 90.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
def test_nothing_read_is_an_error(kind: str) -> None:
    with pytest.raises(ComparisonError, match="no pair"):
        judge_by(kind, RULE, planned=5).close()  # type: ignore[arg-type]


def test_while_no_reference_moved_evidence_waits_for_one_that_does() -> None:
    judge = EvidenceJudge(RULE)
    assert [judge.read(100.0, 0.0) for _ in range(30)] == [None] * 30

    assert judge.read(90.0, 90.0) == "pass"
    assert judge.routes == 31


def test_a_verdict_of_another_name_is_refused() -> None:
    with pytest.raises(ValueError, match="evidence, list, point"):
        judge_by("vote", RULE, planned=5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("forms", "succeeds"),
    [
        *[(mean_forms(share, ">=", margin=0.1, low=0.0, high=1.0), share) for share in (0.03, 0.05, 0.1, 0.2)],
        *[(degradation_forms(limit), 1.0 - limit) for limit in (0.8, 0.9, 0.95)],
    ],
)
@pytest.mark.parametrize("routes", [20, 44, 60])
def test_what_just_holds_by_rare_successes_seldom_fails(forms: LinearForms, succeeds: float, routes: int) -> None:
    draw, top = random.Random(7), 100.0 if forms.relative else 1.0
    fails = 0
    for _ in range(600):
        drawn = [(top * (draw.random() < succeeds), top) for _ in range(routes)]
        decision, _ = read_until_decided(EvidenceJudge(forms), drawn)
        fails += decision == "fail"
        p_value = fail_p_value(forms, [one for one, _ in drawn], [other for _, other in drawn])
        assert (decision == "fail") is (p_value <= 0.05)
    assert fails <= 0.05 * 600


def test_many_routes_without_a_success_break_even_a_low_limit() -> None:
    forms = mean_forms(0.05, ">=", margin=0.1, low=0.0, high=1.0)
    assert [read(EvidenceJudge(forms), [(0.0, 0.0)] * routes)[0] for routes in (20, 60, 75)] == [
        "inconclusive",
        "inconclusive",
        "fail",
    ]


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

    def p_mean_below_zero(values: list[float]) -> float:
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
        unseen = (1.0 / (1.0 + keep)) ** len(hold) if max(hold) <= 1e-10 else 0.0
        if max(unseen, p_mean_below_zero(hold)) <= 0.8 * alpha:
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
    import random

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


@pytest.mark.parametrize(("threshold", "margin", "alpha"), [(1.0, 0.1, 0.05), (0.3, 0.0, 0.05), (0.3, 0.1, 0.5)])
def test_a_threshold_margin_or_alpha_that_leaves_nothing_to_decide_is_refused(
    threshold: float, margin: float, alpha: float
) -> None:
    with pytest.raises(ValueError, match="expected"):
        gate([90.0], [90.0], threshold, margin, alpha)


@pytest.mark.parametrize("order", ["import pytest_drive_robust.stats.judges", "pass"])
def test_the_gate_is_a_function_of_the_package_and_importing_it_costs_nothing(order: str) -> None:
    code = (
        f"import sys\n{order}\nfrom pytest_drive_robust import stats\nfrom pytest_drive_robust.stats import gate\n"
        "from pytest_drive_robust.stats.judges import gate as same\n"
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


@pytest.mark.parametrize("limit", [-0.05, -0.10, -0.15])
def test_how_many_routes_a_limit_takes_that_scores_hardly_reach_is_all_of_them(limit: float) -> None:
    assert judge_by("evidence", degradation_forms(limit), planned=60).likely_left(60) == 60
