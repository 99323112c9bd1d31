"""A verdict stops its test, as an assert does: what the test states after it is missing, and nobody may miss that."""

from __future__ import annotations

import json

import pytest
from suite_runs import processes, run

from pytest_drive_robust.cli.main import main

SUITE = """
import os
import pytest
from pytest_drive_robust import requirements

FIRST, SECOND = requirements(f"DS under throttle 0.9 >= {os.environ.get('LIMIT', '1')}", "DS under clean >= 1")
"""
STOPS = "def test_both(drive):\n    drive.check(FIRST)\n    drive.check(SECOND)\n"
ENDS = "def test_both(drive):\n    drive.check(SECOND)\n    drive.check(FIRST)\n"
ASSERTS = "def test_both(drive):\n    assert drive.ds('throttle 0.9') >= 101\n    assert drive.ds('clean') >= 1\n"
LAST_ASSERT = "def test_own(drive):\n    assert drive.ds('throttle 0.9') >= 101\n"
SKIPS = (
    "def test_both(drive):\n    if drive.ds('throttle 0.9') < 101:\n        pytest.skip()\n    drive.check(SECOND)\n"
)
IN_A_FIXTURE = """
@pytest.fixture
def checked(drive):
    drive.check(FIRST)

def test_both(drive, checked):
    drive.check(SECOND)
"""
AFTER_THE_TEST = """
@pytest.fixture
def checked(drive):
    yield
    drive.check(FIRST)
    drive.check(SECOND)

def test_both(drive, checked):
    pass
"""
SUBTESTS = """
def test_both(drive, subtests):
    for stated in (FIRST, SECOND):
        with subtests.test(str(stated)):
            drive.check(stated)
"""
TWO_IN_A_SUBTEST = """
def test_both(drive, subtests):
    with subtests.test("both"):
        drive.check(FIRST)
        drive.check(SECOND)
"""
NOTE = (
    "test_suite.py::test_both stopped at call 1 of drive: what stands after that was not judged and is not in this "
    "report"
)
TOLD = "*  stopped: at call 1 of drive in this test; what it states after that was not judged"
needs_subtests = pytest.mark.skipif(not hasattr(pytest, "Subtests"), reason="subtests come with pytest 9")


@pytest.fixture
def broken(monkeypatch):
    monkeypatch.setenv("LIMIT", "100")


def document(folder):
    return json.loads((folder.path / "run.json").read_text(encoding="utf-8"))


@processes
@pytest.mark.parametrize("test", [STOPS, IN_A_FIXTURE, AFTER_THE_TEST], ids=["body", "fixture", "teardown"])
def test_a_test_that_its_first_verdict_stops_says_so(suite, broken, test, workers):
    folder = suite(test=SUITE + test)
    result = run(folder, "--drive-json=run.json", *workers)
    assert result.ret == 1
    result.stdout.fnmatch_lines([TOLD])
    assert document(folder)["notes"] == [NOTE]
    assert document(folder)["stopped_tests"] == ["test_suite.py::test_both"]
    assert [judged["requirement"] for judged in document(folder)["requirements"]] == ["DS under throttle 0.9 >= 100"]


@pytest.mark.parametrize("test", [ASSERTS, SKIPS], ids=["assert", "skip"])
def test_what_stops_a_test_after_a_measurement_is_told_of_too(suite, test):
    folder = suite("DS under clean >= 1", test=SUITE + test)
    run(folder, "--drive-json=run.json").stdout.fnmatch_lines(
        ["test_suite.py::test_both stopped at call 1 of drive: *"]
    )
    assert document(folder)["notes"] == [NOTE]
    assert document(folder)["stopped_tests"] == ["test_suite.py::test_both"]


def test_a_test_that_its_last_verdict_breaks_has_not_stopped(suite, broken):
    folder = suite(test=SUITE + ENDS)
    result = run(folder, "--drive-json=run.json")
    assert result.ret == 1
    result.stdout.no_fnmatch_line(TOLD)
    assert document(folder)["stopped_tests"] == []
    assert document(folder)["notes"] == []


@processes
def test_a_test_that_fails_by_its_own_assert_at_its_end_is_told_of(suite, workers):
    folder = suite("DS under clean >= 1", test=SUITE + LAST_ASSERT)
    result = run(folder, "--drive-json=run.json", *workers)
    assert result.ret == 1
    told = "test_suite.py::test_own failed by its own assert or pytest.fail, which is no requirement of this report"
    assert told in " ".join(result.stdout.str().split())
    assert document(folder)["stopped_tests"] == []
    assert document(folder)["notes"] == [told]
    assert document(folder)["own_verdicts"] == ["test_suite.py::test_own"]


@pytest.mark.parametrize(("limit", "exit_code"), [(101, 0), (1, 1)], ids=["fails", "passes"])
def test_a_test_that_is_expected_to_fail_by_its_own_assert_is_not_told_of(suite, limit, exit_code):
    folder = suite(test=SUITE + "@pytest.mark.xfail(strict=True)\n" + LAST_ASSERT.replace("101", str(limit)))
    assert run(folder, "--drive-json=run.json").ret == exit_code
    assert document(folder)["notes"] == document(folder)["own_verdicts"] == []


@needs_subtests
def test_a_subtest_stops_alone(suite, broken):
    folder = suite(test=SUITE + SUBTESTS)
    result = run(folder, "--drive-json=run.json")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*DS under throttle 0.9 = *, limit >= 100*"])
    result.stdout.no_fnmatch_line(TOLD)
    assert [judged["verdict"] for judged in document(folder)["requirements"]] == ["fail", "pass"]
    assert document(folder)["stopped_tests"] == []


@needs_subtests
def test_a_subtest_of_two_verdicts_stops_at_the_first(suite, broken):
    folder = suite(test=SUITE + TWO_IN_A_SUBTEST)
    run(folder, "--drive-json=run.json").stdout.fnmatch_lines([TOLD])
    assert document(folder)["stopped_tests"] == ["test_suite.py::test_both"]


@processes
def test_a_setting_that_a_stopped_test_no_longer_asked_for_is_not_gone_in_silence(suite, monkeypatch, capsys, workers):
    folder = suite(test=f"{SUITE}\n@pytest.mark.xfail(strict=False)\n{STOPS}")
    assert run(folder, "--drive-save=before").ret == 0
    monkeypatch.setenv("LIMIT", "100")
    result = run(folder, "--drive-compare=before", "--drive-save=after", *workers)
    result.assert_outcomes(xfailed=1)
    assert result.ret == 1
    told = "NOT JUDGED: 1 of 2 settings against before: steady under clean: not scored: a verdict stopped test_suite.py"
    result.stdout.fnmatch_lines([f"{told}::test_both, which may have asked for it after that"])
    capsys.readouterr()
    assert main(["compare", "before", "after"]) == 1
    assert told in capsys.readouterr().out
    assert main(["-p", "conftest.py", "limits", "--run", "after", "--agent", "steady"]) == 4
    assert "'after' is incomplete: a verdict stopped test_suite.py::test_both, so" in capsys.readouterr().err
    assert run(folder, "--drive-compare=after", *workers).ret == 0  # that one lacks the setting, too
