"""Two snapshots: whether RD rose, from the clean and perturbed scores of both."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st
from snapshot_factory import BUSY, PRINT, cell, snapshot, terms

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Perturbation
from pytest_drive_robust.registry.registry import default_registry, forget_names, hide_names
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot, Taken
from pytest_drive_robust.report.comparison import comparison_text


def test_a_rise_of_rd_sees_a_drop_that_the_clean_score_shares_as_none() -> None:
    clean, weak = cell(BUSY), cell([score * 0.8 for score in BUSY], setting="200 ms latency")
    slower_clean = cell([score * 0.7 for score in BUSY])
    slower_weak = cell([score * 0.56 for score in BUSY], setting="200 ms latency")
    comparison = compare(snapshot(clean, weak), snapshot(slower_clean, slower_weak), terms("rd:+0.05"))
    assert [item.verdict for item in comparison.cells] == ["pass", "pass"]
    assert comparison.cells[1].before.rd == pytest.approx(0.2)
    assert comparison.cells[1].after.rd == pytest.approx(0.2)


def test_a_rise_of_rd_is_found() -> None:
    clean, weak = cell(BUSY), cell([score * 0.8 for score in BUSY], setting="200 ms latency")
    weaker = cell([score * 0.5 for score in BUSY], setting="200 ms latency")
    comparison = compare(snapshot(clean, weak), snapshot(clean, weaker), terms("rd:+0.05", "sr:-0.5"))
    assert [item.verdict for item in comparison.cells] == ["pass", "fail"]
    assert [finding.verdict for finding in comparison.cells[1].findings] == ["fail", "pass"]


SCORES = st.lists(st.tuples(*[st.sampled_from([20.0, 60.0, 100.0])] * 4), min_size=20, max_size=30)


@given(SCORES, st.booleans())
def test_a_rise_of_rd_is_judged_by_evidence_as_soon_as_one_of_the_four_scores_of_a_route_changed(
    scores: list[tuple[float, float, float, float]], unchanged: bool
) -> None:
    clean, weak, clean_now, weak_now = (list(column) for column in zip(*scores, strict=True))
    if unchanged:
        clean_now, weak_now = clean, weak
    old = snapshot(cell(clean), cell(weak, setting="200 ms latency"))
    new = snapshot(cell(clean_now), cell(weak_now, setting="200 ms latency"))
    (finding,) = compare(old, new, terms("rd:+0.04")).cells[1].findings
    changed = 0 if unchanged else sum(row[:2] != row[2:] for row in scores)
    assert finding.changed == changed
    assert finding.rule == ("evidence" if changed else "list")


def test_an_rd_that_rises_because_only_clean_scores_do_is_no_list() -> None:
    clean = [100.0] * 20 + [60.0] * 10 + [30.0] * 10
    better = [100.0 if 30 <= place < 34 else score for place, score in enumerate(clean)]
    weak = cell([70.0] * 20 + [50.0] * 10 + [20.0] * 10, setting="200 ms latency")
    comparison = compare(snapshot(cell(clean), weak), snapshot(cell(better), weak), terms("rd:+0.04"))
    found = comparison.cells[1]
    assert found.after.rd - found.before.rd == pytest.approx(0.064, abs=1e-3)  # type: ignore[operator]
    assert (found.verdict, found.changed, found.findings[0].changed) == ("inconclusive", 0, 4)
    text = comparison_text(comparison, colour=False)
    assert "driver under 200 ms latency: 0 of 40 routes changed, 4 with their clean scores" in text
    assert "neither shown nor ruled out: RD rises by 0.04 at most; 0.28 -> 0.34 (+0.06) on 40 routes" in text


def test_an_rd_whose_clean_scores_are_of_other_seeds_is_evidence() -> None:
    weak = cell([60.0] * 10, setting="200 ms latency")
    old, new = snapshot(cell([90.0] * 10), weak), snapshot(cell([90.0] * 10, seed=1), weak)
    (finding,) = compare(old, new, terms("rd:+0.05")).cells[1].findings
    assert (finding.rule, finding.verdict) == ("evidence", "inconclusive")


def test_an_rd_is_paired_by_seed_where_its_clean_setting_was_driven_with_more_of_them() -> None:
    def run_of(kept: float) -> Snapshot:
        cells = []
        for setting, scores in (("clean", (80.0, 20.0)), ("200 ms latency", (80.0 * kept,))):
            taken = [Taken(seed, ds, False, "stuck") for seed, ds in enumerate(scores)]
            score = RouteScore.of("1", "Accident", taken, digest="d0", fingerprint=PRINT)
            cells.append(Cell("driver", setting, "routes.xml", {"1": score}))
        return snapshot(*cells)

    found = compare(run_of(1.0), run_of(0.9), terms("rd:+0.05")).cells[1]
    assert (found.before.rd, found.after.rd) == (0.0, pytest.approx(0.1))
    assert found.verdict == "fail"


def test_a_success_that_was_lost_without_a_change_of_its_driving_score_is_a_change() -> None:
    old, new = (snapshot(cell([100.0] * 20, success=success)) for success in (True, False))
    comparison = compare(old, new, terms("ds:-5%", "sr:-0.05"))
    (found,) = comparison.cells
    assert [(item.rule, item.changed, item.verdict) for item in found.findings] == [
        ("list", 0, "pass"),
        ("evidence", 20, "fail"),
    ]
    assert found.changed == 20


def test_a_rise_of_rd_is_not_judged_where_both_runs_hold_clean_settings_only() -> None:
    clean, worse = snapshot(cell([90.0] * 40)), snapshot(cell([10.0] * 40))
    with pytest.raises(UsageError, match=r"nothing to judge: only a rise of RD .* as in ds:-5%"):
        compare(clean, worse, terms("rd:+0.05"))
    assert compare(clean, worse, terms("rd:+0.05", "ds:-5%")).regressed


def test_rd_without_clean_episodes_is_an_error_not_a_pass() -> None:
    weak = snapshot(cell(BUSY, setting="200 ms latency"))
    (found,) = compare(weak, weak, terms("rd:+0.05")).cells
    assert found.verdict == "error"
    assert "clean episodes" in found.findings[0].problem
    assert found.regressed
    worse = snapshot(cell([score * 0.5 for score in BUSY], setting="200 ms latency"))
    (found,) = compare(weak, worse, terms("ds:-5%", "rd:+0.05")).cells
    assert [finding.verdict for finding in found.findings] == ["fail", "error"]
    assert found.verdict == "error"


def test_rd_under_a_setting_with_a_warm_up_reads_the_clean_scores_of_that_warm_up() -> None:
    warm, late = "0 ms latency (reading=released)", "200 ms latency (reading=released)"
    run = snapshot(cell([100.0] * 4), cell([80.0] * 4, setting=warm), cell([60.0] * 4, setting=late))
    assert compare(run, run).cells[2].before.rd == pytest.approx(0.25)


@dataclass
class Dimmed(Perturbation):
    """A failure of a user with a warm-up of its own."""

    gain: float = 0.5
    warmup_ticks: int = 40
    phrase = "dimmed camera {gain}"


def test_rd_under_a_failure_of_a_user_reads_the_clean_scores_of_the_warm_up_of_the_stack() -> None:
    warm, late = "0 ms latency (reading=released)", "dimmed camera 0.5 and 200 ms latency (reading=released)"
    run = snapshot(cell([100.0] * 4), cell([80.0] * 4, setting=warm), cell([60.0] * 4, setting=late))
    assert compare(run, run).cells[2].before.rd == pytest.approx(0.25)
    warmer = cell([50.0] * 4, setting="0 ms latency (mode=hold, warmup_ticks=40)")
    run = snapshot(cell([100.0] * 4), warmer, cell([30.0] * 4, setting=late))
    kept = hide_names()
    try:
        default_registry().register_perturbation(Dimmed)
        assert compare(run, run).cells[2].before.rd == pytest.approx(0.4)
    finally:
        forget_names(kept)


def test_rd_under_the_failure_of_a_user_reads_the_clean_scores() -> None:
    run = snapshot(cell([100.0] * 4), cell([75.0] * 4, setting="dimmed camera 0.5"))
    assert compare(run, run).cells[1].before.rd == pytest.approx(0.25)


def test_rd_of_agents_of_other_names_reads_the_clean_scores_of_each() -> None:
    old, new = (
        snapshot(cell([clean] * 4, agent=agent), cell([60.0] * 4, agent=agent, setting="200 ms latency"))
        for agent, clean in (("old", 80.0), ("new", 100.0))
    )
    found = compare(old, new, terms("rd:+0.05")).cells[1]
    assert (found.before.rd, found.after.rd) == pytest.approx((0.25, 0.4))
    assert found.verdict == "fail"


@pytest.mark.parametrize("lacking", ["before", "after"])
def test_rd_is_of_the_routes_whose_clean_scores_both_runs_have(lacking: str) -> None:
    weak = cell([50.0, 50.0, 0.0], setting="200 ms latency")
    whole, short = snapshot(cell([100.0, 100.0, 100.0]), weak), snapshot(cell([100.0, 100.0]), weak)
    old, new = (short, whole) if lacking == "before" else (whole, short)
    found = compare(old, new, terms("rd:+0.05", rule="point")).cells[1]
    assert (found.routes, found.findings[0].routes, found.findings[0].verdict) == (3, 2, "pass")
    assert found.before.rd == found.after.rd == 0.5
