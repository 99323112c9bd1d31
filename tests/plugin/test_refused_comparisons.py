"""Runs that cannot be stored or compared are refused before anything is driven, where the plan already shows it."""

from __future__ import annotations

import json

import pytest
from compared_runs import ALSO, EVIDENCE, HOLDS, many_routes, refused, stored
from suite_runs import processes, run

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (("--drive-compare=befor",), "there is no stored run named 'befor', nor any other. Store one"),
        (("--drive-compare=baseline",), "no baseline was blessed yet"),
        (("--drive-compare=missing.json",), "there is no run file named 'missing.json'"),
        (("--drive-compare", "test_suite.py"), "If it was meant as a path to collect, put it before --drive-compare"),
        (("--drive-compare",), "no stored run. Store one with --drive-save"),
        (("--drive-save", "test_suite.py"), "If it was meant as a path to collect, put it before --drive-save"),
        (("--drive-save=latest",), "is a reserved word"),
        (("--drive-fail-on=ds:+5%",), "--drive-fail-on is 'ds:+5%', but DS gets worse"),
        (("--drive-fail-on=,",), "--drive-fail-on is ',', which is empty; expected a drop of DS or SR"),
        (("-o", "drive_fail_on= , "), "--drive-fail-on is ',', which is empty; expected a drop of DS or SR"),
        (("--drive-seeds=,",), "--drive-seeds is ',', expected whole numbers >= 0"),
        (("--drive-seeds", "9" * 5000), "which cannot be used: Exceeds the limit (4300 digits)"),
        (("--drive-json", "a\0.json"), "which cannot be used: embedded null byte"),
        (("--drive-routes=routes.xml:,",), "no route ids after 'routes.xml'"),
        (("--drive-results=,",), "--drive-results holds ',', expected SETTING=FOLDER"),
        (("--drive-on-mismatch=wrn",), "Did you mean 'warn'?"),
        (("--drive-fail-on=ds:-5%",), "--drive-fail-on says how runs are compared. Add --drive-compare RUN, or"),
        (("--drive-on-mismatch=warn",), "--drive-on-mismatch says how runs are compared"),
        (("--drive-agent", ""), "--drive-agent is empty, expected NAME: drive this agent: "),
        (("--drive-compare=",), "--drive-compare is empty, expected REF: judge every setting against a stored run"),
        (("--drive-results", " "), "--drive-results is empty, expected LIST: judge official results"),
        (("--drive-save", "a" * 300), "aaa', which cannot be used: File name too long."),
        (("--drive-agent", f"{'a' * 300}:Mine"), ":Mine' needs the module 'aaa"),
        (("-s", "--drive-act-timeout", "1s"), "--drive-act-timeout needs worker processes"),
        (("--drive-executor", "inline", "--drive-memory", "4"), "--drive-memory needs worker processes"),
        (("-s", "--drive-workers", "4"), "--drive-workers needs worker processes"),
        (("--drive-ray-address", "auto"), "--drive-ray-address needs --drive-executor ray"),
        (("--drive-waivers=none.toml",), "there is no file"),
        (("--drive-baselines=blessed",), "--drive-baselines is read to compare runs. Add --drive-compare"),
        (("--drive-b2d-root=x",), "--drive-b2d-root needs --drive-sim bench2drive: add that, or leave"),
        (("--drive-b2d-python=python3",), "--drive-b2d-python needs --drive-sim bench2drive"),
        (("--drive-sim=bench2driv",), "there is no simulator named 'bench2driv'. Did you mean 'bench2drive'?"),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, tuple) else "",
)
def test_what_cannot_be_used_is_refused_before_anything_was_driven(suite, driven, args, told):
    result = run(suite(HOLDS), *args)
    assert result.ret == 4
    assert told in "\n".join((*result.outlines, *result.errlines))
    assert driven() == []


def test_a_store_that_cannot_be_written_is_refused_before_a_run_is_driven_for_it(suite, driven):
    folder = suite(HOLDS)
    (folder.path / ".drive-robust").write_text("a file")
    result = run(folder, "--drive-store=off", "--drive-save")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*--drive-save is 'auto', but '*.drive-robust' cannot be written to."])
    assert driven() == []


def test_a_run_of_another_simulator_is_refused_before_anything_was_driven(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    (folder.path / "driven.log").unlink()
    result = run(folder, "--drive-sim=broken", "--drive-compare=before")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*this run cannot be compared with before: the simulator was fake and is broken*"])
    assert driven() == []


@processes
def test_routes_that_became_others_refuse_the_comparison(suite, driven, workers):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    save_routes([fake_route(str(number), length_m=7.0) for number in (1, 2, 3)], folder.path / "routes.xml")
    told = refused(folder, driven, "--drive-compare=before", *workers)
    assert (
        "could not be compared with before: 3 of 3 routes have changed under the same id: 1, 2, 3. Drive both" in told
    )
    assert "or give --drive-on-mismatch=warn" in told
    assert run(folder, "--drive-compare=before", "--drive-on-mismatch=warn").ret == 0


@processes
def test_fewer_routes_than_before_are_refused(suite, driven, workers):
    folder = suite(HOLDS, ALSO)
    run(folder, "--drive-save=before")
    one = ("--drive-routes", "routes.xml:1", "--drive-compare=before")
    told = refused(folder, driven, *one, *workers)
    assert "this run could not be compared with before: this run lacks routes of before: 2 of 3 under " in told
    assert "Drive these routes, too, or give --drive-on-mismatch=warn." in told
    allowed = run(folder, *one, "--drive-on-mismatch=warn", "-k", "clean")
    assert allowed.ret == 0
    allowed.stdout.fnmatch_lines(
        ["no regression on 1 of 3 routes in 1 of 2 settings against before: not one score changed"]
    )


ONE_ID = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.drive_robust(routes="day.xml")
def test_day({fixture}):
    {drive}.check(requirement("DS") >= 1)

@pytest.mark.drive_robust(agent="{agent}", routes="night.xml")
def test_night({fixture}):
    {drive}.check(requirement("DS") >= 1)
"""


def one_id(suite, *, fixture="drive", drive="drive", agent="seer"):
    """Two tests, each with a route file of its own; both files have a route 1, but not the same."""
    folder = suite(test=ONE_ID.format(fixture=fixture, drive=drive, agent=agent))
    for name, length_m in (("day", 9.0), ("night", 12.0)):
        save_routes([fake_route("1", length_m=length_m)], folder.path / f"{name}.xml")
    return folder


@processes
@pytest.mark.parametrize("option", ["--drive-save", "--drive-compare=before", "--drive-report=look"])
def test_two_routes_of_one_id_are_refused_where_ids_tell_routes_apart(suite, driven, workers, option):
    run(suite(ALSO), "--drive-save=before")
    told = refused(one_id(suite), driven, option, *workers)
    assert "ERROR: day.xml and night.xml use the id '1' for two routes. Stored runs, comparisons and pages" in told


def test_two_routes_of_one_id_are_judged_where_no_id_tells_them_apart(suite):
    run(one_id(suite), "--drive-json=run.json").assert_outcomes(passed=2)


def test_two_routes_of_one_id_that_no_plan_shows_are_not_stored(suite):
    folder = one_id(suite, fixture="request", drive='request.getfixturevalue("drive")', agent="steady")
    result = run(folder, "--drive-save=before")
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        ["ERROR: the run was not stored: the run 'this run' holds two routes with the id '1' *"]
    )
    assert not (folder.path / ".drive-robust" / "runs" / "before.json").exists()


def test_another_time_of_standing_is_refused(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    told = refused(folder, driven, "--drive-compare=before", "--drive-stuck-stop=60")
    assert "episodes of a stuck agent were never stopped early and are stopped after 60 s" in told


def test_another_version_of_the_simulator_is_refused(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    path = folder.path / ".drive-robust" / "runs" / "before.json"
    document = stored(folder, "before")
    version = document["episodes"][0]["versions"]["fake"]
    for episode in document["episodes"]:
        episode["versions"]["fake"] = "of last year"
    path.write_text(json.dumps(document))
    told = refused(folder, driven, "--drive-compare=before")
    assert f"the simulator was fake (of last year) and is fake ({version})" in told


def test_other_versions_are_refused_before_driving_where_that_was_asked_for(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    path = folder.path / ".drive-robust" / "runs" / "before.json"
    document = stored(folder, "before")
    (python,) = {episode["versions"]["python"] for episode in document["episodes"]}
    for episode in document["episodes"]:
        episode["versions"]["python"] = "3.0"
    path.write_text(json.dumps(document))
    assert run(folder, "--drive-compare=before").ret == 0
    told = refused(folder, driven, "--drive-compare=before", "--drive-on-mismatch=refuse")
    assert f"python was 3.0 and is {python}" in told


def test_a_run_with_nothing_in_common_is_refused(suite, driven):
    folder = suite(HOLDS, ALSO)
    run(folder, "--drive-save=before", "-k", "clean")
    told = refused(folder, driven, "--drive-compare=before", "-k", "0.9")
    assert "they have no agent, setting and route in common. This run drives steady under throttle 0.9" in told
    assert "before holds steady under clean." in told


def test_a_rise_of_rd_alone_is_refused_where_both_runs_drive_clean_alone(suite, driven):
    folder = suite(ALSO)
    run(folder, "--drive-save=before")
    told = refused(folder, driven, "--drive-compare=before", "--drive-fail-on=rd:+0.05")
    assert "there is nothing to judge: only a rise of RD is to fail" in told


def test_a_run_whose_time_was_spent_is_no_reference(suite, driven):
    folder = suite(HOLDS)
    run(folder, "--drive-save=before")
    document = stored(folder, "before")
    del document["episodes"][1:]
    document["summaries"][0]["episodes_finished"] = 1
    (folder.path / "early.json").write_text(json.dumps(document))
    told = refused(folder, driven, "--drive-compare=early.json")
    assert "could not be compared with early.json: early.json is incomplete under throttle 0.9: 2 episodes were" in told
    assert "Run the command of that run again, or give --drive-on-mismatch=warn." in told


def test_a_run_that_stopped_at_its_verdicts_is_no_reference(suite, driven):
    folder = suite(HOLDS)
    many_routes(folder)
    run(folder, EVIDENCE, "--drive-json=early.json")
    told = refused(folder, driven, EVIDENCE, "--drive-compare=early.json")
    assert "with early.json: early.json was driven only until its verdicts were clear" in told
    assert "Drive that run with --drive-save or --drive-verdict=point, or" in told
    run(folder, "--drive-verdict=point", "--drive-json=whole.json")
    assert run(folder, EVIDENCE, "--drive-compare=whole.json").ret == 0
