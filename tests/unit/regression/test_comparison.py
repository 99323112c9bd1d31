"""Two snapshots: verdicts, flips, mismatches."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from snapshot_factory import BUSY, PRINT, cell, route_score, snapshot, terms

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Taken
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.stats import gate


def test_the_same_scores_pass_and_nothing_flips() -> None:
    comparison = compare(snapshot(cell(BUSY)), snapshot(cell(BUSY)))
    (found,) = comparison.cells
    assert (found.verdict, found.routes, found.changed, found.flips) == ("pass", 64, 0, ())
    assert not comparison.regressions
    assert not comparison.mismatches


def test_a_clear_drop_is_a_regression_with_its_flips_worst_first() -> None:
    worse = [score * 0.5 for score in BUSY]
    worse[0] = 5.0
    (found,) = compare(snapshot(cell(BUSY)), snapshot(cell(worse))).cells
    assert found.verdict == "fail"
    assert found.before.ds > found.after.ds
    assert found.changed == 64
    assert len(found.flips) == BUSY.count(100.0)
    assert all(flip.fails for flip in found.flips)
    assert found.flips[0].after.route_id == "1"


def test_the_route_that_lost_most_comes_first_though_another_ended_lower() -> None:
    old, new = cell([60.0, 100.0, 70.0], success=True), cell([40.0, 50.0, 45.0], success=False)
    (found,) = compare(snapshot(old), snapshot(new)).cells
    assert [flip.after.route_id for flip in found.flips] == ["2", "3", "1"]


def test_better_is_never_a_regression_and_its_flips_come_last() -> None:
    before = {"1": 20.0, "2": 100.0, "3": 50.0}
    after = {"1": 100.0, "2": 90.0, "3": 50.0}
    (found,) = compare(snapshot(cell(before)), snapshot(cell(after)), terms("ds:-5%", rule="point")).cells
    assert found.verdict == "pass"
    assert [(flip.fails, flip.after.route_id) for flip in found.flips] == [(True, "2"), (False, "1")]


def test_three_routes_show_nothing_by_evidence() -> None:
    old, new = snapshot(cell([100.0] * 3)), snapshot(cell([10.0] * 3))
    (found,) = compare(old, new, terms("ds:-5%", rule="evidence")).cells
    assert found.verdict == "inconclusive"
    assert len(found.flips) == 3


@pytest.mark.parametrize(
    ("routes", "seed", "rule", "verdict"),
    [(19, 0, "list", "fail"), (19, 1, "evidence", "inconclusive"), (20, 0, "evidence", "fail")],
)
def test_without_a_rule_few_routes_are_a_list_unless_their_seeds_are_others(
    routes: int, seed: int, rule: str, verdict: str
) -> None:
    old = snapshot(cell([80.0] * routes))
    (worse,) = compare(old, snapshot(cell([55.0] * routes, seed=seed))).cells
    assert (worse.findings[0].rule, worse.verdict) == (rule, verdict)


def test_the_same_seeds_without_one_changed_score_pass_on_any_number_of_routes() -> None:
    for routes in (1, 19, 20, 44):
        old = snapshot(cell([60.0] * routes))
        (same,) = compare(old, old).cells
        assert (same.findings[0].rule, same.verdict) == ("list", "pass")
        (other,) = compare(old, snapshot(cell([60.0] * routes, seed=1))).cells
        assert (other.findings[0].rule, other.verdict) == ("evidence", "inconclusive")


def test_one_route_of_other_seeds_makes_them_other_seeds() -> None:
    old = cell([80.0] * 10)
    stray = route_score("7", 55.0, seed=1)
    (found,) = compare(snapshot(old), snapshot(replace(old, routes={**old.routes, "7": stray}))).cells
    assert not found.same_seeds
    assert (found.findings[0].rule, found.verdict) == ("evidence", "inconclusive")


def test_what_is_open_is_told_only_where_something_changed_and_was_judged() -> None:
    old, other = snapshot(cell([80.0] * 10)), snapshot(cell([80.0] * 10, seed=1))
    (unchanged,) = compare(old, other).cells
    assert (unchanged.verdict, unchanged.is_open) == ("inconclusive", False)
    (changed,) = compare(old, snapshot(cell([79.0] * 10, seed=1))).cells
    assert (changed.verdict, changed.is_open) == ("inconclusive", True)
    weak, weaker = (snapshot(cell([score] * 10, setting="occlusion 0.5", seed=1)) for score in (80.0, 79.0))
    (error,) = compare(weak, weaker, terms("ds:-5%", "rd:+0.05", rule="evidence")).cells
    assert [finding.is_open for finding in error.findings] == [True, False]
    assert (error.verdict, error.is_open) == ("error", False)


def test_few_routes_are_told_about() -> None:
    old = snapshot(cell([80.0] * 3))
    assert compare(old, old).notes == ()
    assert compare(old, snapshot(cell([80.0, 80.0, 79.0]))).notes == (
        "verdicts on 3 routes by the rule list: they speak of exactly these routes and seeds",
    )
    assert compare(old, snapshot(cell([80.0] * 3, seed=1))).notes == (
        "3 routes with other seeds show little: drive 20 or more, or the same routes and seeds",
    )
    assert compare(snapshot(cell([80.0] * 20)), snapshot(cell([80.0] * 20, seed=1))).notes == ()


def test_a_run_in_which_nothing_was_scored_says_why() -> None:
    with pytest.raises(UsageError, match=r"\(0 routes, 1 not scored: 7, seed 0: no map\)"):
        compare(snapshot(cell([80.0])), snapshot(cell([], broken=("7, seed 0: no map",))))


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(0, 100)), min_size=1, max_size=60))
def test_the_verdict_on_a_relative_drop_is_that_of_the_gate(pairs: list[tuple[float, float]]) -> None:
    before, after = zip(*pairs, strict=True)
    old, new = snapshot(cell(before)), snapshot(cell(after))
    (found,) = compare(old, new, terms("ds:-5%", rule="evidence")).cells
    order = compare_order(old.cells["driver", "clean"], new.cells["driver", "clean"])
    expected = gate([before[n] for n in order], [after[n] for n in order], 0.05)
    assert found.verdict == expected.verdict


def compare_order(old: Cell, new: Cell) -> list[int]:
    from pytest_drive_robust.runner.planned_order import planned_order

    types = [score.scenario for score in new.routes.values()]
    return [int(route) - 1 for route in planned_order(list(old.routes), types, "driver clean")]


def test_what_got_worse_is_told_apart_from_what_was_not_scored() -> None:
    old = snapshot(cell(BUSY), cell(BUSY, setting="200 ms latency"))
    worse, broken = [score * 0.5 for score in BUSY], ("7, seed 0: no map",)
    comparison = compare(old, snapshot(cell(worse), cell(BUSY, setting="200 ms latency", broken=broken)))
    told = comparison_text(comparison, colour=False).splitlines()[-1]
    assert told == "REGRESSION: 1 of 2 settings against run: driver under clean; 1 not judged"
    assert [item.setting for item in comparison.regressions] == ["clean"]


def test_the_seeds_of_a_route_are_one_value_and_the_worst_of_them_is_told() -> None:
    taken = [Taken(0, 100.0, True, "completed"), Taken(1, 40.0, False, "stuck"), Taken(2, 100.0, True, "completed")]
    score = RouteScore.of("1", "Kind", taken, digest="", fingerprint=PRINT)
    assert (score.ds, score.seeds, score.worst_seed, score.outcome) == (80.0, (0, 1, 2), 1, "stuck")
    assert score.sr == pytest.approx(2 / 3)
    assert score.succeeds
    assert not route_score("1", 99.0).succeeds


def test_a_route_of_which_half_of_the_seeds_succeeded_does_not_and_of_equals_the_first_seed_is_the_worst() -> None:
    taken = [Taken(1, 60.0, False, "stuck"), Taken(0, 60.0, True, "completed")]
    score = RouteScore.of("1", "Kind", taken, digest="", fingerprint=PRINT)
    assert (score.sr, score.succeeds) == (0.5, False)
    assert (score.seeds, score.worst_seed, score.outcome) == ((0, 1), 0, "completed")
