from __future__ import annotations

import random
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.errors import ComparisonError
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


def test_a_list_that_turns_out_shorter_is_judged_by_its_value() -> None:
    scores = [(90.0, 90.0), None, (70.0, 90.0)]

    assert read_until_decided(ListJudge(RULE, planned=3), scores) == ("pass", 3)
    assert read_until_decided(ListJudge(degradation_forms(0.10), planned=3), scores) == ("fail", 3)
    assert read_until_decided(ListJudge(RULE, planned=2), [None, None]) == ("inconclusive", 2)
    with pytest.raises(ComparisonError, match="no pair"):
        read_until_decided(ListJudge(RULE, planned=0), [])


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


@pytest.mark.parametrize("pair", [(80.0, 56.0), (33.2, 23.24)])
def test_equal_to_the_limit_passes_by_point_and_by_list_although_rounding_puts_it_below(pair) -> None:
    assert RULE.hold(56.0, 80.0) == 0.0 > RULE.hold(23.24, 33.2)
    pairs = [pair] * 30

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


def test_a_list_that_ends_before_its_end_is_inconclusive_and_one_route_more_changes_nothing() -> None:
    judge = ListJudge(RULE, planned=20)
    judge.read(70.0, 100.0)
    assert judge.close() == "inconclusive"

    judge = ListJudge(RULE, planned=1)
    with pytest.raises(ComparisonError, match="no pair"):
        judge.close()
    assert judge.read(70.0, 100.0) == "pass"
    assert judge.read(0.0, 100.0) == "pass"
    with pytest.raises(ComparisonError, match="the list has 0 routes, but one more was read"):
        ListJudge(RULE, planned=0).read(70.0, 100.0)


def mean_over_bets(first: float, second: float) -> float:
    """What the three gamblers own after two stakes."""
    return sum((1.0 + bet * first) * (1.0 + bet * second) for bet in (0.2, 0.5, 0.9)) / 3.0


def test_a_list_bets_on_what_the_routes_left_must_average() -> None:
    judge = ListJudge(mean_forms(0.5, ">=", margin=0.1, low=0.0, high=1.0), planned=4)
    judge.read(1.0)  # half a success too many, so the other three may be short of a sixth each
    judge.read(0.0)
    assert judge.within.value == pytest.approx(mean_over_bets(1.0, -1.0))
    assert judge.against.value == pytest.approx(mean_over_bets(-1.0, (-1 / 6 + 0.5) / (0.5 + 1 / 6)))


def test_a_list_bets_on_what_the_references_left_must_average_for_the_floor() -> None:
    judge = ListJudge(RULE, planned=4, floor=30.0)
    judge.read(63.0, 90.0)  # 30 are left for the other three
    judge.read(0.0, 0.0)
    assert judge.above_floor.value == pytest.approx(mean_over_bets(60 / 30, -10 / 10))
    assert judge.below_floor.value == pytest.approx(mean_over_bets(-60 / 70, 10 / 90))


def test_a_list_without_a_range_bets_nothing_and_is_read_to_the_end() -> None:
    rule = mean_forms(60.0, ">=", margin=5.0)

    assert read(ListJudge(rule, planned=40), [(0.0, 100.0), (0.0, 30.0)] * 20) == ("pass", 40)


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
@pytest.mark.parametrize("wrong", [float("nan"), 300.0, -300.0])
def test_a_score_that_cannot_be_is_refused(kind: str, wrong: float) -> None:
    with pytest.raises(ComparisonError, match="outside"):
        judge_by(kind, RULE, planned=5).read(wrong, 90.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
@pytest.mark.parametrize("wrong", [-0.01, 1.01])
def test_a_share_just_outside_its_range_is_refused(kind: str, wrong: float) -> None:
    forms = mean_forms(0.5, ">=", margin=0.1, low=0.0, high=1.0)
    with pytest.raises(ComparisonError, match="outside"):
        judge_by(kind, forms, planned=5).read(wrong)


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
def test_nothing_read_is_an_error(kind: str) -> None:
    with pytest.raises(ComparisonError, match="no pair"):
        judge_by(kind, RULE, planned=5).close()  # type: ignore[arg-type]


def test_a_fail_that_must_be_surer_takes_more_routes_and_a_pass_does_not() -> None:
    def taken(pair: tuple[float, float], fail_alpha: float) -> tuple[str, int]:
        return read(judge_by("evidence", RULE, planned=60, fail_alpha=fail_alpha), [pair] * 60)

    usual, surer = taken((90.0, 10.0), 0.05), taken((90.0, 10.0), 0.005)
    assert usual[0] == surer[0] == "fail"
    assert usual[1] < surer[1] < 60
    assert taken((90.0, 90.0), 0.005) == taken((90.0, 90.0), 0.05)


@pytest.mark.parametrize("fail_alpha", [0.0, -0.01, 0.051])
def test_a_fail_that_may_be_less_sure_than_a_pass_is_refused(fail_alpha: float) -> None:
    with pytest.raises(ValueError, match="the alpha of a fail is"):
        EvidenceJudge(RULE, alpha=0.05, fail_alpha=fail_alpha)


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
    # 0.95 ** 58 is more than alpha, 0.95 ** 59 is less
    forms = mean_forms(0.05, ">=", margin=0.1, low=0.0, high=1.0)
    assert [read(EvidenceJudge(forms), [(0.0, 0.0)] * routes)[0] for routes in (20, 58, 59)] == [
        "inconclusive",
        "inconclusive",
        "fail",
    ]


@pytest.mark.parametrize("spread", [0.0, 2.0, 10.0])
@pytest.mark.parametrize(
    ("forms", "usual", "makes_up"),
    [
        (degradation_forms(0.30), (70.0, 100.0), (100.0, 0.0)),
        (degradation_forms(0.05), (95.0, 100.0), (100.0, 0.0)),
        (mean_forms(-5.0, ">=", margin=10.0, low=-100.0, high=100.0), (-5.0, 0.0), (100.0, 0.0)),
    ],
)
@pytest.mark.parametrize("routes", [20, 44])
def test_what_just_holds_by_few_routes_that_make_up_for_the_others_seldom_fails(
    forms: LinearForms, usual: tuple[float, float], makes_up: tuple[float, float], spread: float, routes: int
) -> None:
    draw, share = random.Random(11), 1.2 / routes
    short = share / (1.0 - share) * forms.hold(*makes_up)
    fails = 0
    for _ in range(300):
        judge = EvidenceJudge(forms)
        for _ in range(routes):
            loss = short + draw.uniform(-spread, spread)
            score, reference = makes_up if draw.random() < share else (usual[0] - loss, usual[1])
            judge.read(score, reference)
        fails += judge.close() == "fail"
    assert fails <= 0.05 * 300


@pytest.mark.parametrize("kind", ["evidence", "list"])
def test_a_pass_waits_until_the_references_are_shown_to_lie_on_one_side_of_the_floor(kind) -> None:
    def taken(clean: float, floor: float) -> tuple[str, int]:
        judge = judge_by(kind, RULE, planned=220, floor=floor)
        return read(judge, [(clean, clean)] * 220)

    soon = taken(90.0, 0.0)[1]
    assert taken(90.0, 30.0) == ("pass", soon)
    for clean in (34.0, 24.0):
        decision, routes = taken(clean, 30.0)
        assert decision == "pass"
        assert taken(clean, 0.0)[1] < routes < 220
    assert taken(30.1, 30.0) == ("pass", 220)


def test_a_list_shows_its_mean_reference_as_soon_as_the_rest_cannot_turn_it() -> None:
    assert read(judge_by("list", RULE, planned=4, floor=30.0), [(100.0, 100.0)] * 4) == ("pass", 3)


@pytest.mark.parametrize("kind", ["evidence", "list"])
def test_a_fail_waits_for_no_floor(kind) -> None:
    pairs = [(31.0, 0.0)] * 220
    found = [read(judge_by(kind, RULE, planned=220, floor=floor), pairs) for floor in (0.0, 30.0)]
    assert found[0] == found[1]
    assert found[0][0] == "fail"
    assert found[0][1] < 220


def test_what_only_waited_for_the_floor_passes_at_the_end_however_few_the_routes_are() -> None:
    assert read(judge_by("evidence", RULE, planned=16), [(90.0, 90.0)] * 16) == ("pass", 13)
    assert read(judge_by("evidence", RULE, planned=16, floor=89.9), [(90.0, 90.0)] * 16) == ("pass", 16)


def test_what_is_shown_of_the_floor_is_the_same_whichever_way_the_limit_is_compared() -> None:
    below, above = (EvidenceJudge(degradation_forms(0.30, comparison=sign), floor=30.0) for sign in ("<=", ">="))
    for reference in (24.0, 90.0, 10.0):
        below.read(0.5 * reference, reference)
        above.read(0.5 * reference, reference)
    assert (below.above_floor.value, below.below_floor.value) == (above.above_floor.value, above.below_floor.value)
