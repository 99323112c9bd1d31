"""The verdict on one allowance."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from snapshot_factory import cell, snapshot

from pytest_drive_robust.regression.allowance import parse_allowances
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.verdicts import Quartet, judge_drop, judge_rise, rise_of
from pytest_drive_robust.report.comparison import comparison_text


def quartets_of(clean_before: float, clean_after: float, *, kept_before: float, kept_after: float) -> list[Quartet]:
    scores = (clean_before, clean_before * kept_before, clean_after, clean_after * kept_after)
    return [Quartet(str(number), *scores) for number in range(200)]


@pytest.mark.parametrize("rule", ["evidence", "list", "point"])
def test_a_rise_of_rd_never_passes_where_a_clean_score_is_below_the_floor(rule) -> None:
    (allowance,) = parse_allowances(["rd:+0.05"], source="test")

    def verdict(clean_before: float, clean_after: float, *, kept_after: float = 0.9) -> str:
        return judge_rise(
            quartets_of(clean_before, clean_after, kept_before=0.9, kept_after=kept_after), allowance, rule=rule
        )

    assert verdict(80.0, 80.0) == verdict(30.0, 30.0) == "pass"
    assert verdict(80.0, 29.0) == verdict(29.0, 80.0) == verdict(0.001, 0.001) == "inconclusive"
    assert verdict(80.0, 29.0, kept_after=0.2) == "fail"
    assert verdict(80.0, 0.0) == "inconclusive"


@pytest.mark.parametrize(("routes", "verdict"), [(20, "inconclusive"), (44, "inconclusive"), (60, "pass")])
def test_a_rise_passes_only_where_one_more_route_that_lost_all_would_not_turn_it(routes: int, verdict: str) -> None:
    (allowance,) = parse_allowances(["rd:+0.05"], source="test")
    assert judge_rise(quartets_of(90.0, 90.0, kept_before=0.9, kept_after=0.9)[:routes], allowance) == verdict


@pytest.mark.parametrize(
    ("text", "held", "missed"),
    [("ds:-5%", 0.98, 0.7), ("ds:-5", 0.98, 0.7), ("sr:-5%", 0.99, 0.7), ("sr:-0.05", 0.99, 0.7)],
)
def test_evidence_decides_a_drop_in_the_unit_of_its_metric(text: str, held: float, missed: float) -> None:
    (allowance,) = parse_allowances([text], source="test")

    def verdict(kept: float) -> str:
        return judge_drop([(allowance.top, allowance.top * kept)] * 100, allowance)

    assert (verdict(held), verdict(missed)) == ("pass", "fail")


@pytest.mark.parametrize(("begins", "goes_on", "verdict"), [(0.0, 100.0, "pass"), (100.0, 30.0, "fail")])
def test_a_list_of_which_all_is_known_is_judged_by_all_of_it(begins: float, goes_on: float, verdict: str) -> None:
    (allowance,) = parse_allowances(["ds:-5%"], source="test")
    pairs = [(60.0, begins)] * 15 + [(60.0, goes_on)] * 29
    assert judge_drop(pairs, allowance, rule="list") == verdict


@pytest.mark.parametrize("text", ["sr:-5%", "ds:-5%"])
def test_what_was_nothing_on_every_route_cannot_drop(text: str) -> None:
    (allowance,) = parse_allowances([text], source="test")
    same, better = [(0.0, 0.0)] * 44, [(0.0, 0.8 * allowance.top)] * 44
    verdicts = {
        rule: (judge_drop(same, allowance, rule=rule), judge_drop(better, allowance, rule=rule))
        for rule in ("list", "point", "evidence")
    }
    assert verdicts == {"list": ("pass", "pass"), "point": ("pass", "pass"), "evidence": ("inconclusive", "pass")}


def test_what_each_route_lost_before_as_well_is_no_noise() -> None:
    (allowance,) = parse_allowances(["rd:+0.05"], source="test")
    rows = [(100.0, kept, 50.0, kept / 2.0) for kept in (20.0, 100.0, 0.0)] * 20  # the clean scores halved, RD is equal
    assert judge_rise(quartets(rows), allowance) == "pass"
    others = [(100.0, before, 50.0, after) for before, (*_, after) in zip([0.0, 20.0, 100.0] * 20, rows, strict=True)]
    assert judge_rise(quartets(others), allowance) == "inconclusive"


@pytest.mark.parametrize("rule", ["list", "point"])
def test_what_rises_by_exactly_the_allowance_passes(rule) -> None:
    def verdict(percent: int, kept_after: float) -> str:
        (allowance,) = parse_allowances([f"rd:+{percent / 100}"], source="test")
        return judge_rise(quartets_of(90.0, 80.0, kept_before=0.9, kept_after=kept_after), allowance, rule=rule)

    for percent in range(1, 60):  # in some of them rounding is against it
        assert verdict(percent, 0.9 - percent / 100) == "pass"
        assert verdict(percent, 0.9 - percent / 100 - 1e-6) == "fail"


@pytest.mark.parametrize("routes", [20, 44, 220])
def test_a_rise_within_the_allowance_by_few_routes_that_make_up_for_the_others_seldom_fails(routes: int) -> None:
    (allowance,) = parse_allowances(["rd:+0.05"], source="test")
    draw, share, fails = random.Random(routes), 1.2 / routes, 0
    usual = 100.0 - (5.0 + 100.0 * share) / (1.0 - share)
    for _ in range(100):
        rows = []
        for _ in range(routes):
            makes_up = draw.random() < share
            rows.append((100.0, 0.0, 100.0, 100.0) if makes_up else (100.0, 100.0, 100.0, usual + draw.gauss(0, 2)))
        fails += judge_rise(quartets(rows), allowance) == "fail"
    assert fails <= 0.05 * 100


SCORES = st.floats(1.0, 100.0)
ROWS = st.lists(st.tuples(SCORES, SCORES, SCORES, SCORES), min_size=2, max_size=12)

CLEAN = {"1": 100.0, "2": 60.0, "3": 80.0, "4": 90.0}


def quartets(rows: list[tuple[float, float, float, float]]) -> list[Quartet]:
    return [Quartet(str(number), *row) for number, row in enumerate(rows)]


@given(ROWS)
def test_it_is_the_difference_of_both_degradations_within_its_interval(
    rows: list[tuple[float, float, float, float]],
) -> None:
    found = rise_of(quartets(rows))
    assert found is not None
    clean_before, before, clean_after, after = (sum(column) for column in zip(*rows, strict=True))
    assert found.before == pytest.approx(1.0 - before / clean_before, abs=1e-9)
    assert found.after == pytest.approx(1.0 - after / clean_after, abs=1e-9)
    assert found.low <= found.after - found.before <= found.high


@given(ROWS)
def test_two_runs_the_other_way_round_have_the_opposite_rise(rows: list[tuple[float, float, float, float]]) -> None:
    there, back = rise_of(quartets(rows)), rise_of(quartets([(row[2], row[3], row[0], row[1]) for row in rows]))
    assert there is not None
    assert back is not None
    assert (back.low, back.high) == pytest.approx((-there.high, -there.low), abs=1e-9)


@given(ROWS)
def test_the_same_setting_twice_has_the_mean_of_itself(rows: list[tuple[float, float, float, float]]) -> None:
    once, twice = rise_of(quartets(rows)), rise_of(quartets(rows), quartets(rows))
    assert once is not None
    assert twice is not None
    assert (twice.before, twice.after, twice.low, twice.high) == pytest.approx(
        (once.before, once.after, once.low, once.high), abs=1e-9
    )
    assert (once.settings, twice.settings) == (1, 2)


def test_of_several_settings_only_the_common_routes_count() -> None:
    first = quartets([(100.0, 50.0, 100.0, 80.0), (100.0, 50.0, 100.0, 80.0), (100.0, 0.0, 100.0, 0.0)])
    second = quartets([(100.0, 90.0, 100.0, 90.0), (100.0, 90.0, 100.0, 90.0)])
    found = rise_of(first, second)
    assert found is not None
    assert (found.before, found.after, found.routes, found.settings) == pytest.approx((0.3, 0.15, 2, 2))


@pytest.mark.parametrize(
    "rows",
    [
        [(100.0, 50.0, 100.0, 80.0)],
        [(0.0, 0.0, 100.0, 80.0), (0.0, 0.0, 100.0, 80.0)],
        [(100.0, 50.0, 0.0, 0.0), (100.0, 50.0, 40.0, 40.0)],
    ],
    ids=["one-route", "no-clean-score", "all-clean-score-on-one-route"],
)
def test_without_anything_to_compare_there_is_no_number(rows: list[tuple[float, float, float, float]]) -> None:
    assert rise_of(quartets(rows)) is None
    assert rise_of() is None


def test_a_comparison_says_what_rd_rose_by_and_what_the_mean_did() -> None:
    noisy, blocked = "GPS noise 5 m", "occlusion 0.5"
    before = snapshot(
        cell(CLEAN), cell([50.0, 30.0, 40.0, 45.0], setting=noisy), cell([100.0, 60.0, 80.0, 90.0], setting=blocked)
    )
    after = snapshot(
        cell(CLEAN), cell([100.0, 60.0, 80.0, 90.0], setting=noisy), cell([60.0, 60.0, 80.0, 90.0], setting=blocked)
    )
    comparison = compare(before, after)
    text = comparison_text(comparison, colour=False)
    assert "  RD 0.500 -> 0.000 (-0.500, 95 % -0.500 to -0.500)" in text
    assert "  RD 0.000 -> 0.121 (+0.121, 95 % " in text
    assert "driver: mean RD of 2 settings 0.250 -> 0.061 (-0.189, 95 % " in text
    assert comparison.mean_rises["driver"].routes == 4


@pytest.mark.parametrize("last", [50.0, 60.0])
def test_a_rise_that_a_low_clean_score_leaves_open_says_so(last: float) -> None:
    clean, noisy = cell([20.0, 10.0, 30.0, 50.0]), [18.0, 9.0, 27.0]
    before, after = (snapshot(clean, cell([*noisy, score], setting="GPS noise 5 m")) for score in (50.0, last))
    terms = Terms(parse_allowances(["rd:+0.05"], source="test"))
    text = comparison_text(compare(before, after, terms), colour=False)
    assert "  left open: RD rises by 0.05 at most; " in text
    assert "    the clean driving score is 27.5, below the floor of 30: RD says nothing yet" in text
    assert "neither shown nor ruled out" not in text


def test_of_two_runs_without_any_change_nothing_is_said() -> None:
    run = snapshot(cell(CLEAN), cell(CLEAN, setting="GPS noise 5 m"), cell(CLEAN, setting="occlusion 0.5"))
    assert "RD 0." not in comparison_text(compare(run, run), colour=False)


def test_a_setting_with_a_route_that_was_not_scored_has_no_rise() -> None:
    whole = snapshot(cell(CLEAN), cell(CLEAN, setting="GPS noise 5 m"))
    broken = snapshot(cell(CLEAN), cell(CLEAN, setting="GPS noise 5 m", broken=("5: the agent raised",)))
    for before, after in ((whole, broken), (broken, whole)):
        comparison = compare(before, after)
        assert all(found.rise is None for found in comparison.cells)
        assert comparison.mean_rises == {}
    assert compare(whole, whole).cells[1].rise is not None
    assert compare(whole, whole).mean_rises == {}, "one setting has no mean"
