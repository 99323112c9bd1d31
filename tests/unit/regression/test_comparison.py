"""Two snapshots: verdicts, flips, mismatches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from snapshot_factory import PRINT, cell, route_score, snapshot, with_versions

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Perturbation
from pytest_drive_robust.registry.registry import default_registry, forget_names, hide_names
from pytest_drive_robust.regression.allowance import parse_allowances
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.fingerprint import AgentPrint
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot, Taken
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.stats import gate

BUSY = [100.0, 60.0, 100.0, 36.0, 100.0, 100.0, 20.0, 80.0] * 8


def terms(*texts: str, **given: object) -> Terms:
    return Terms(parse_allowances(texts, source="--fail-on"), **given)  # type: ignore[arg-type]


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


def test_one_route_that_was_driven_in_another_world_is_found_among_the_others() -> None:
    new = cell(BUSY)
    stray = route_score("7", BUSY[6], fingerprint=with_versions(fake="2"))
    (refusal,) = compare(snapshot(cell(BUSY)), snapshot(replace(new, routes={**new.routes, "7": stray}))).refusals
    assert refusal.text == "the simulator was fake (1) and is fake (2)"


def test_what_got_worse_is_told_apart_from_what_was_not_scored() -> None:
    old = snapshot(cell(BUSY), cell(BUSY, setting="200 ms latency"))
    worse, broken = [score * 0.5 for score in BUSY], ("7, seed 0: no map",)
    comparison = compare(old, snapshot(cell(worse), cell(BUSY, setting="200 ms latency", broken=broken)))
    told = comparison_text(comparison, colour=False).splitlines()[-1]
    assert told == "REGRESSION: 1 of 2 settings against run: driver under clean; 1 not judged"
    assert [item.setting for item in comparison.regressions] == ["clean"]


def test_an_incomplete_run_is_no_reference() -> None:
    told = "38 episodes were not driven, as the run ended before, or a verdict was an error"
    comparison = compare(snapshot(cell(BUSY[:6], broken=(told,))), snapshot(cell(BUSY)))
    (refusal,) = comparison.refusals
    assert refusal.text == f"run is incomplete under clean: {told}"
    assert compare(snapshot(cell(BUSY)), snapshot(cell(BUSY, broken=(told,)))).refusals == ()  # the new one is an error


def test_an_episode_that_broke_now_is_an_error() -> None:
    broken = cell(BUSY, broken=("7, seed 0: no map",))
    (found,) = compare(snapshot(cell(BUSY)), snapshot(broken)).cells
    assert found.verdict == "error"
    assert "no map" in found.findings[0].problem


@pytest.mark.parametrize(
    "told", ["7, seed 0: no map", "24 episodes were not driven, as the run ended before, or a verdict was an error"]
)
def test_a_setting_of_which_nothing_was_scored_is_not_judged_and_red(told: str) -> None:
    old = snapshot(cell(BUSY), cell(BUSY, setting="200 ms latency"))
    new = snapshot(cell(BUSY), cell([], setting="200 ms latency", broken=(told,)))
    comparison = compare(old, new)
    assert [item.verdict for item in comparison.cells] == ["pass"]
    assert comparison.unscored == (f"driver under 200 ms latency: not scored: {told}",)
    assert comparison.regressed
    assert comparison.notes == ()
    text = comparison_text(comparison, colour=False)
    assert f"error: driver under 200 ms latency: not scored: {told}" in text
    told = f"NOT JUDGED: 1 of 2 settings against run: driver under 200 ms latency: not scored: {told}"
    assert text.splitlines()[-1] == told


def test_only_common_routes_count_and_the_others_are_told() -> None:
    before = cell({"1": 100.0, "2": 100.0, "3": 10.0})
    (found,) = compare(snapshot(before), snapshot(cell({"1": 100.0, "2": 100.0, "9": 0.0}))).cells
    assert (found.routes, found.missing, found.added, found.after.ds) == (2, 1, 1, 100.0)


def test_routes_that_the_new_run_lacks_refuse_and_settings_that_it_lacks_are_notes() -> None:
    old = snapshot(cell(BUSY), cell(BUSY, setting="occlusion 0.5"), cell(BUSY, setting="200 ms latency"), label="old")
    new = snapshot(cell(BUSY[:5]), cell(BUSY[:5], setting="occlusion 0.5"), label="new")
    comparison = compare(old, new)
    (mismatch,) = comparison.refusals
    assert mismatch.kind == "routes"
    assert mismatch.text == "new lacks routes of old: 59 of 64 under clean (6, 7, 8, 9, 10 and 54 more), and 1 more"
    assert comparison.notes == ("not in new: driver under 200 ms latency",)
    assert not compare(old, new, Terms(policy="warn")).refusals
    assert not compare(new, old).refusals
    whole = snapshot(cell(BUSY), cell(BUSY, setting="occlusion 0.5"), label="new")
    assert not compare(old, whole).mismatches


def test_five_routes_that_the_new_run_lacks_are_all_named() -> None:
    old, new = snapshot(cell(BUSY[:10])), snapshot(cell(BUSY[:5]), label="new")
    assert [item.text for item in compare(old, new).refusals] == [
        "new lacks routes of run: 5 of 10 under clean (6, 7, 8, 9, 10)"
    ]


def test_a_setting_without_one_common_route_lacks_routes_too() -> None:
    old = snapshot(cell({"1": 100.0}), cell({"1": 100.0}, setting="occlusion 0.5"))
    new = snapshot(cell({"1": 100.0}), cell({"2": 100.0}, setting="occlusion 0.5"), label="new")
    assert [item.text for item in compare(old, new).refusals] == [
        "new lacks routes of run: 1 of 1 under occlusion 0.5 (1)"
    ]


def test_a_run_that_ended_early_is_an_error_and_not_another_set_of_routes() -> None:
    short = cell(BUSY[:5], broken=("59 episodes were not driven, as the run ended before, or a verdict was an error",))
    comparison = compare(snapshot(cell(BUSY)), snapshot(short))
    assert not comparison.refusals
    assert comparison.regressed


def test_a_setting_that_a_stopped_test_may_have_asked_for_is_not_judged_and_another_agents_is_a_note() -> None:
    old = snapshot(cell(BUSY), cell(BUSY, setting="occlusion 0.5"), cell(BUSY, agent="other"))
    new = replace(snapshot(cell(BUSY), label="new"), stopped_tests=("test_it.py::test_two", "test_it.py::test_more"))
    comparison = compare(old, new)
    told = "a verdict stopped test_it.py::test_two and 1 more, which may have asked for it after that"
    assert comparison.unjudged == (f"driver under occlusion 0.5: not scored: {told}",)
    assert comparison.regressed
    assert comparison.notes == ("not in new: other under clean",)


def test_a_run_that_stopped_at_its_verdicts_is_refused_in_one_sentence() -> None:
    new = replace(cell(BUSY[:5]), stopped=("5 of 64 routes of routes.xml",))
    (refusal,) = compare(snapshot(cell(BUSY)), snapshot(new, label="new")).refusals
    assert refusal.text == (
        "new was driven only until its verdicts were clear, so its scores cannot be compared: "
        "5 of 64 routes of routes.xml under clean"
    )


def test_settings_that_one_run_lacks_are_notes() -> None:
    old = snapshot(cell(BUSY), cell(BUSY, setting="occlusion 0.5"), label="old")
    new = snapshot(cell(BUSY), cell(BUSY, setting="occlusion 0.8"), label="new")
    assert compare(old, new).notes == (
        "not in new: driver under occlusion 0.5",
        "not in old: driver under occlusion 0.8",
    )
    assert compare(old, new).elsewhere == 2
    assert compare(old, old).elsewhere == 0


def test_two_agents_of_other_names_are_compared_when_there_is_no_doubt() -> None:
    comparison = compare(snapshot(cell(BUSY, agent="old")), snapshot(cell(BUSY, agent="new")))
    assert comparison.cells[0].agent == "new"
    assert comparison.notes == ("old is compared with new",)


def test_nothing_in_common_cannot_be_compared() -> None:
    with pytest.raises(UsageError, match=r"nothing to compare: a holds driver under clean \(1 routes\); b holds"):
        compare(snapshot(cell({"1": 1.0}), label="a"), snapshot(cell({"2": 1.0}), label="b"))


def test_another_simulator_or_route_refuses_and_another_library_warns() -> None:
    old = snapshot(cell(BUSY))
    worlds = {
        "simulator": cell(BUSY, fingerprint=with_versions(fake="2")),
        "routes": cell(BUSY, digest="d1"),
        "versions": cell(BUSY, fingerprint=with_versions(numpy="3.0")),
    }
    for kind, new in worlds.items():
        comparison = compare(old, snapshot(new))
        assert [item.kind for item in comparison.mismatches] == [kind]
        assert bool(comparison.refusals) == (kind != "versions")
        assert not compare(old, snapshot(new), Terms(policy="warn")).refusals
        assert compare(old, snapshot(new), Terms(policy="refuse")).refusals


def test_another_way_to_stop_stuck_episodes_is_another_simulator() -> None:
    new = snapshot(cell(BUSY, fingerprint=replace(PRINT, stuck_stop_s=30.0)))
    (mismatch,) = compare(snapshot(cell(BUSY)), new).refusals
    assert mismatch.text == "episodes of a stuck agent were never stopped early and are stopped after 30 s"


def test_a_run_that_names_its_vehicle_is_read_all_the_same() -> None:
    """As development versions with two of them wrote it."""
    old = snapshot(cell(BUSY, fingerprint=with_versions(**{**PRINT.versions, "vehicle": "mkz"})))
    assert not compare(old, snapshot(cell(BUSY))).mismatches


def test_a_changed_agent_is_told_and_never_refused() -> None:
    new = snapshot(cell(BUSY, fingerprint=replace(PRINT, agent=AgentPrint("agents 2", "bbbbbbbbbbbb", "cc"))))
    comparison = compare(snapshot(cell(BUSY)), new, Terms(policy="refuse"))
    assert not comparison.refusals
    assert comparison.mismatches[0].text == (
        "the agent driver changed: agents 1 became agents 2, source aaaaaaaaaaaa became bbbbbbbbbbbb, "
        "weights unknown became cc"
    )


def test_what_was_not_known_of_an_agent_before_is_no_change_of_it() -> None:
    old = snapshot(cell(BUSY, fingerprint=replace(PRINT, agent=AgentPrint())))
    assert compare(old, snapshot(cell(BUSY))).mismatches == ()


@pytest.mark.parametrize(("before", "after", "told"), [("aa", "bb", 1), ("aa", "aa", 0), (None, "bb", 0)])
def test_another_machine_matters_only_to_agents_whose_bits_depend_on_it(
    before: str | None, after: str | None, told: int
) -> None:
    known = [{} if digest is None else {"machine torch": digest} for digest in (before, after)]
    old, new = (snapshot(cell(BUSY, fingerprint=with_versions(**versions))) for versions in known)
    mismatches = compare(old, new).mismatches
    assert [item.kind for item in mismatches] == ["versions"] * told
    assert all("the torch of this machine gives other bits" in item.text for item in mismatches)
    assert all("--stored-controls" in item.text for item in mismatches)


def test_routes_whose_content_was_not_recorded_are_no_mismatch() -> None:
    recorded, not_recorded = snapshot(cell(BUSY)), snapshot(cell(BUSY, digest=""))
    assert not compare(not_recorded, recorded).mismatches
    assert not compare(recorded, not_recorded).mismatches


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
