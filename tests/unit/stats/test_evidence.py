from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import (
    LinearForms,
    Wealth,
    degradation_forms,
    fail_p_value,
    last_fail_p,
    last_pass_p,
    mean_below_zero_p,
    mean_forms,
    unseen_p,
)
from pytest_drive_robust.stats.judges import EvidenceJudge

score = st.floats(0.0, 100.0)
comparisons = st.sampled_from(["<=", ">="])


@given(st.lists(st.tuples(score, score), min_size=1, max_size=20), st.floats(-0.5, 0.9), comparisons)
def test_hold_sums_to_0_or_more_exactly_when_the_degradation_meets_the_limit(
    pairs: list[tuple[float, float]], limit: float, comparison: str
) -> None:
    rule = degradation_forms(limit, comparison=comparison)
    clean = sum(before for before, _ in pairs)
    assume(clean > 1.0)
    rd = 1.0 - sum(after for _, after in pairs) / clean
    assume(abs(rd - limit) > 1e-6)

    total = math.fsum(rule.hold(after, before) for before, after in pairs)
    assert (total >= 0.0) == (rd <= limit if comparison == "<=" else rd >= limit)


@given(st.lists(score, min_size=1, max_size=20), st.floats(1.0, 99.0), comparisons, st.floats(0.1, 20.0))
def test_hold_and_slack_of_a_mean_are_its_distance_to_the_limit_without_and_with_the_margin(
    values: list[float], limit: float, comparison: str, margin: float
) -> None:
    rule = mean_forms(limit, comparison, low=0.0, high=100.0, margin=margin)
    mean = math.fsum(values) / len(values)
    distance = mean - limit if comparison == ">=" else limit - mean
    given_way = math.fsum(map(rule.slack, values)) / len(values) - distance

    assert math.fsum(map(rule.hold, values)) / len(values) == pytest.approx(distance)
    assert 0.0 < given_way <= margin * (1 + 1e-9) + 1e-9


@given(score, score, st.floats(-0.5, 0.9), comparisons, st.floats(0.01, 0.5))
def test_the_ranges_of_a_rule_hold_every_route(
    before: float, after: float, limit: float, comparison: str, margin: float
) -> None:
    relative = degradation_forms(limit, margin, comparison=comparison)
    plain = mean_forms(50.0 + 49.0 * limit, comparison, low=0.0, high=100.0, margin=100.0 * margin)

    for rule, reference in ((relative, before), (plain, 0.0)):
        assert -rule.floor - 1e-9 <= rule.hold(after, reference) <= rule.most + 1e-9
        assert rule.slack(after, reference) >= -rule.least - 1e-9


def verdict(rule: LinearForms, values: list[float]) -> tuple[str, int]:
    judge = EvidenceJudge(rule)
    for value in values:
        if judge.read(value) is not None:
            break
    return judge.close(), judge.routes


def test_a_success_rate_is_judged_in_both_directions() -> None:
    mostly, rarely = ([1.0] * 9 + [0.0]) * 10, ([0.0] * 9 + [1.0]) * 10
    at_least = mean_forms(0.60, ">=", low=0.0, high=1.0, margin=0.10)
    at_most = mean_forms(0.40, "<=", low=0.0, high=1.0, margin=0.10)

    assert verdict(at_least, mostly)[0] == "pass"
    assert verdict(at_least, rarely)[0] == "fail"
    assert verdict(at_most, mostly)[0] == "fail"
    assert verdict(at_most, rarely)[0] == "pass"
    assert verdict(at_least, rarely)[1] < 20
    assert verdict(at_least, rarely)[1] == verdict(at_most, mostly)[1]


def test_a_degradation_can_be_asked_for() -> None:
    judge = EvidenceJudge(degradation_forms(0.30, comparison=">="))
    for _ in range(60):
        judge.read(20.0, 90.0)

    assert judge.close() == "pass"


def test_without_an_upper_end_a_mean_passes_early_but_fails_in_the_last_look_only() -> None:
    rule = mean_forms(60.0, ">=", low=0.0, margin=10.0)
    quick, slow = [110.0, 90.0, 240.0, 100.0] * 25, [20.0, 30.0, 45.0, 10.0] * 25

    assert verdict(rule, quick)[0] == "pass"
    assert verdict(rule, quick)[1] < 100
    assert verdict(rule, slow) == ("fail", 100)


def test_without_an_upper_end_a_ceiling_fails_early_but_passes_in_the_last_look_only() -> None:
    rule = mean_forms(150.0, "<=", low=0.0, margin=10.0)

    assert verdict(rule, [500.0, 400.0] * 50)[0] == "fail"
    assert verdict(rule, [500.0, 400.0] * 50)[1] < 100
    assert verdict(rule, [100.0, 90.0, 80.0, 85.0] * 25) == ("pass", 100)


def test_values_that_only_rounding_put_below_the_limit_do_not_fail() -> None:
    assert verdict(mean_forms(60.0, ">=", low=0.0, margin=10.0), [60.0 - 1e-13] * 20)[0] != "fail"


def test_one_failure_disproves_that_all_routes_succeed() -> None:
    rule = mean_forms(1.0, ">=", low=0.0, high=1.0, margin=0.10)

    assert verdict(rule, [1.0, 1.0, 0.0, 1.0]) == ("fail", 3)
    assert verdict(rule, [1.0] * 100)[0] == "pass"


def test_what_always_holds_passes_at_once() -> None:
    assert verdict(mean_forms(0.0, ">=", low=0.0, high=1.0, margin=0.10), [0.0]) == ("pass", 1)


def test_a_margin_that_would_leave_the_range_is_cut() -> None:
    rule = mean_forms(0.06, ">=", low=0.0, high=1.0, margin=0.10)

    assert rule.lenient_base == pytest.approx(0.03)
    assert verdict(rule, [0.0] * 100)[0] == "fail"


@pytest.mark.parametrize(
    "make",
    [
        lambda: degradation_forms(1.0),
        lambda: degradation_forms(math.nan),
        lambda: degradation_forms(1.1, comparison=">="),
        lambda: degradation_forms(0.3, margin=0.0),
        lambda: degradation_forms(0.3, comparison="<"),
        lambda: mean_forms(101.0, ">=", low=0.0, high=100.0, margin=10.0),
        lambda: mean_forms(50.0, ">=", low=0.0, high=100.0, margin=math.inf),
        lambda: mean_forms(math.inf, ">=", margin=1.0),
    ],
)
def test_a_rule_that_decides_nothing_is_refused(make: object) -> None:
    with pytest.raises(ValueError, match=r"expected|Expected"):
        make()  # type: ignore[operator]


@pytest.mark.parametrize("value", [-1.1, -math.inf, math.nan])
def test_a_bet_on_a_value_below_its_range_is_refused(value: float) -> None:
    with pytest.raises(ComparisonError, match="outside the range"):
        Wealth().bet(value)


def test_a_bet_on_a_value_that_only_rounding_put_below_its_range_is_one_on_its_end() -> None:
    assert Wealth().bet(-1.0 - 1e-12) == Wealth().bet(-1.0) == pytest.approx((0.8 + 0.5 + 0.1) / 3.0, rel=1e-15)


@pytest.mark.parametrize(("routes", "short"), [(20, 1.0), (20, 30.0), (44, 2.0), (220, 5.0)])
def test_routes_that_all_lose_the_same_leave_the_chance_that_none_was_drawn_of_those_that_lose_nothing(
    routes: int, short: float
) -> None:
    assert unseen_p([-short] * routes, 100.0) == pytest.approx((100.0 / (100.0 + short)) ** routes)


def test_scores_without_a_reference_above_0_are_no_evidence_of_a_fail() -> None:
    forms = degradation_forms(0.30, comparison=">=")

    assert fail_p_value(forms, [50.0] * 30, [0.0] * 30) == 1.0
    assert fail_p_value(forms, [50.0] * 30, [1.0] * 30) < 0.05


losses = st.lists(st.floats(-100.0, 100.0), min_size=20, max_size=60)


@given(losses, st.floats(1.0, 100.0))
def test_what_was_not_drawn_counts_more_the_better_it_may_be_and_never_makes_a_fail_easier(
    holds: list[float], most: float
) -> None:
    alone = mean_below_zero_p(holds)
    assert alone <= unseen_p(holds, most) <= unseen_p(holds, 2.0 * most) <= 1.0
    assert last_fail_p(holds, most) >= alone / 0.8 == last_fail_p(holds, math.inf)


def test_without_an_end_the_worst_that_was_not_seen_is_as_far_out_as_the_farthest_route() -> None:
    slacks = [3.0, 8.0, -40.0, 12.0] * 6

    assert last_pass_p(slacks, math.inf) == last_pass_p(slacks, 40.0) > last_pass_p(slacks, 0.0)


def test_where_one_route_moves_the_mean_by_little_the_test_alone_decides() -> None:
    holds = [-70.0, -70.0, -40.0, 30.0, 30.0, 10.0, -20.0, 25.0] * 10
    assert 0.001 < mean_below_zero_p(holds) < 0.05
    assert last_fail_p(holds, 100.0) == mean_below_zero_p(holds) / 0.8
