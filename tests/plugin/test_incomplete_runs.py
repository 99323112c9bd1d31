"""A run that ended early, or of which tests broke, replaces no complete run and is not taken for a whole one."""

from __future__ import annotations

import json
import re

import pytest
from compared_runs import ALSO, BROKEN, HOLDS, refused, stored
from suite_runs import processes, run

from pytest_drive_robust.cli.main import main


def test_a_run_that_ended_early_replaces_no_complete_one(suite):
    folder = suite(HOLDS, ALSO)
    run(folder, "--drive-save=before")
    kept = stored(folder, "before")
    conftest = folder.path / "conftest.py"
    interrupt = """

def pytest_runtest_logreport(report):
    if report.when == "call":
        raise KeyboardInterrupt
"""
    conftest.write_text(conftest.read_text() + interrupt)
    told = folder.runpytest_subprocess("--drive-robust", "--drive-save=before").stdout.str()
    assert "not stored: this run is incomplete, so the stored run before stays as it was" in told
    assert stored(folder, "before") == kept
    told = folder.runpytest_subprocess("--drive-robust", "--drive-save=early").stdout.str()
    assert "stored as early, incomplete: run again before you compare with it" in told
    assert "next:" not in told


@processes
def test_a_run_that_its_first_failure_ended_replaces_no_complete_one(suite, workers):
    folder = suite(BROKEN, *(f"DS under throttle 0.{number} >= 1" for number in range(1, 9)))
    run(folder, "--drive-save=before", *workers)
    kept = stored(folder, "before")
    told = run(folder, "--drive-save=before", "--drive-json=run.json", "-x", *workers).stdout.str()
    assert "not stored: this run is incomplete, so the stored run before stays as it was" in told
    assert stored(folder, "before") == kept
    note, unstored = json.loads((folder.path / "run.json").read_text())["notes"]
    assert re.match(r"the run (ended early|was interrupted): requirements whose tests had not ended by then", note)
    assert unstored.startswith("not stored: this run is incomplete")


@processes
def test_a_run_that_its_first_failure_ended_is_not_taken_for_whole(suite, driven, monkeypatch, capsys, workers):
    monkeypatch.delenv("CI", raising=False)
    folder = suite(HOLDS, BROKEN, *(f"DS under throttle 0.{number} >= 1" for number in range(1, 9)))
    run(folder, "--drive-save=before")
    run(folder, "--drive-save=early", "-x", *workers)
    assert stored(folder, "early")["ended_early"] is True
    assert stored(folder, "before")["ended_early"] is False
    capsys.readouterr()
    assert main(["compare", "before", "early"]) == 1
    told = capsys.readouterr().out.splitlines()
    assert re.match(r"NOT JUDGED: \d of \d+ settings against before: steady under throttle 0\.\d: not sc", told[-1])
    assert "not scored: not all tests of the run came to their verdicts" in told[-1]
    assert main(["compare", "early", "before"]) == 4
    lacks = "not all tests of early came to their verdicts, and it lacks steady"
    assert f"NOT COMPARED with early: {lacks}" in capsys.readouterr().out
    assert main(["bless", "early", "--reason", "why"]) == 4
    assert "early is incomplete: not all of its tests came to their verdicts." in capsys.readouterr().err
    assert main(["-p", "conftest.py", "limits", "--run", "early", "--agent", "steady"]) == 4
    assert "'early' is incomplete: not all of its tests came to their verdicts. Such" in capsys.readouterr().err
    told = refused(folder, driven, "--drive-compare=early")
    assert f"this run could not be compared with early: {lacks}" in told
    assert run(folder, "--drive-compare=early", "-k", "throttle-0.9 and not 100").ret == 0  # all of this is in it


@pytest.mark.parametrize(
    ("workers", "crash", "told"),
    [
        ((), "def pytest_runtest_logfinish():\n    raise RuntimeError('a plugin that breaks')\n", "ended early"),
        (
            ("-n1", "--max-worker-restart=0"),
            "@pytest.hookimpl(trylast=True)\ndef pytest_runtest_teardown(nextitem):\n    os._exit(3)\n",
            "lost a worker process",
        ),
    ],
    ids=["pytest", "worker"],
)
def test_a_run_that_a_crash_ended_is_not_taken_for_whole(suite, workers, crash, told):
    folder = suite(HOLDS, ALSO, conftest=f"\n\n{crash}")
    folder.runpytest_subprocess("--drive-robust", "--drive-save=early", *workers)
    document = stored(folder, "early")
    assert document["ended_early"] is True
    assert document["notes"] == [
        f"the run {told}: requirements whose tests had not ended by then are not in this report"
    ]


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])
def test_a_run_of_which_a_test_broke_before_it_asked_is_not_taken_for_whole(suite, monkeypatch, workers):
    flaky = "\n\n@pytest.fixture(autouse=True)\ndef network(request):\n"
    flaky += '    assert "throttle" not in request.node.name or "DOWN" not in os.environ, "no network"\n'
    folder = suite(HOLDS, ALSO, conftest=flaky)
    run(folder, "--drive-save=before")
    kept = stored(folder, "before")
    monkeypatch.setenv("DOWN", "today")
    result = run(folder, "--drive-save=before", "--drive-compare=before", *workers)
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["*NOT JUDGED: 1 of 2 settings against before: steady under throttle 0.9: *"])
    assert stored(folder, "before") == kept
    run(folder, "--drive-save=down", *workers)
    document = stored(folder, "down")
    assert document["ended_early"] is True
    (note,) = document["notes"]
    assert re.match(r"test_suite.py::test_requirement\[ds-throttle\S+ broke: what it had not judged ", note)


def test_a_run_without_a_file_that_cannot_be_collected_is_not_taken_for_whole(suite):
    folder = suite(HOLDS)
    (folder.path / "test_other.py").write_text("import nothing_of_that_name")
    run(folder, "--drive-save=early", "--continue-on-collection-errors")
    document = stored(folder, "early")
    assert document["ended_early"] is True
    assert document["notes"] == ["test_other.py broke: what it had not judged by then is not in this report"]


def test_a_run_of_which_a_test_broke_between_two_verdicts_is_not_taken_for_whole(suite):
    body = "    drive.ds('clean')\n    open('missing.txt')\n    drive.ds('throttle 0.9')\n"
    folder = suite(HOLDS, test=f"\n\ndef test_both(drive):\n{body}")
    run(folder, "--drive-save=early").assert_outcomes(passed=1, failed=1)
    document = stored(folder, "early")
    assert document["ended_early"] is True
    assert document["notes"] == ["test_suite.py::test_both broke: what it had not judged by then is not in this report"]


def test_a_run_with_a_test_that_fails_for_itself_is_complete(suite):
    own = "    assert False\n\ndef test_plain():\n    assert False\n"
    folder = suite(HOLDS, test=f"\n\ndef test_own(drive):\n    drive.ds('throttle 0.9')\n{own}")
    run(folder, "--drive-save=before").assert_outcomes(passed=1, failed=2)
    assert stored(folder, "before")["ended_early"] is False


def test_a_run_whose_last_test_failed_is_complete_with_x_too(suite):
    folder = suite(ALSO, BROKEN)
    result = run(folder, "--drive-save=before", "--drive-json=run.json", "-x")
    result.stdout.fnmatch_lines(["stored as before; *"])
    assert json.loads((folder.path / "run.json").read_text())["notes"] == []


def test_a_run_whose_episodes_the_store_lost_meanwhile_says_so_and_is_not_taken_for_whole(suite):
    cleaning = """
import shutil
from pathlib import Path


def test_that_cleans():
    shutil.rmtree(Path(__file__).parent / ".drive-robust")
"""
    folder = suite(HOLDS, test=cleaning)
    told = run(folder, "--drive-json=run.json", "-n1").stdout.str()
    assert "the store lost 3 episodes that verdicts rest on while the run was under way" in " ".join(told.split())
    document = json.loads((folder.path / "run.json").read_text())
    assert document["ended_early"] is True
    assert any("the store lost" in note for note in document["notes"])
    run(folder, "--drive-json=run.json", "-n1", "-k", "requirement")
    assert json.loads((folder.path / "run.json").read_text())["ended_early"] is False
