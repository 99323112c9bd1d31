"""Two snapshots: what refuses to be compared, what is not judged, and what is only told."""

from __future__ import annotations

from dataclasses import replace

import pytest
from snapshot_factory import BUSY, PRINT, cell, route_score, snapshot, with_versions

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.fingerprint import AgentPrint
from pytest_drive_robust.report.comparison import comparison_text


def test_one_route_that_was_driven_in_another_world_is_found_among_the_others() -> None:
    new = cell(BUSY)
    stray = route_score("7", BUSY[6], fingerprint=with_versions(fake="2"))
    (refusal,) = compare(snapshot(cell(BUSY)), snapshot(replace(new, routes={**new.routes, "7": stray}))).refusals
    assert refusal.text == "the simulator was fake (1) and is fake (2)"


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
