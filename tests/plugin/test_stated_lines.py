"""Where a failure says that its requirement is stated."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from suite_runs import RED, run

TWO_STATED = """
import pytest
from pytest_drive_robust import requirement, requirements

GREEN, RED = requirements(
    "RD under throttle 0.9 <= 0.30",
    "DS under throttle 0.3 >= 60",
)


@pytest.mark.parametrize("first, second", [(GREEN, RED)])
def test_of_two(drive, first, second):
    drive.check(first)
    drive.check(second)


@pytest.mark.parametrize("first", [GREEN])
def test_of_one_and_another(drive, first):
    drive.check(first)
    drive.check(requirement("DS") <= 5)
"""


@pytest.mark.parametrize("reading", [(), ("--drive-reading", "released")], ids=["paper", "released"])
def test_a_failure_names_the_line_of_the_requirement_that_is_broken(suite, reading):
    folder = suite(test=TWO_STATED)
    result = run(folder, "-o", "junit_family=xunit1", "--junitxml=junit.xml", *reading)
    result.assert_outcomes(failed=2)
    assert [line for line in result.outlines if "stated:" in line] == ["  stated:  test_suite.py:7"]
    lines = [case.get("line") for case in ElementTree.parse(folder.path / "junit.xml").getroot().iter("testcase")]
    assert lines == ["6", "16"], "from 0: of the sentence, and of the test that has none for what is broken"


def test_a_sentence_behind_the_end_of_a_line_in_a_string_is_found(suite):
    test = """
from pytest_drive_robust import requirements

def test_it(drive):
    for stated in requirements("DS under clean >= 1\\nDS under throttle 0.3 >= 60"):
        drive.check(stated)
"""
    run(suite(test=test)).stdout.fnmatch_lines(["  stated:  test_suite.py:5"])


def test_a_sentence_that_two_tests_state_is_that_of_the_test(suite):
    test = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("stated", requirements("DS under throttle 0.3 >= 60"))
def test_before(drive, stated):
    drive.check(stated)
@pytest.mark.drive_robust(seeds=[0])
@pytest.mark.parametrize("stated", requirements("DS under throttle 0.3 >= 60"))
def test_behind(drive, stated):
    drive.check(stated)
"""
    told = [line for line in run(suite(test=test)).outlines if "stated:" in line]
    assert told == ["  stated:  test_suite.py:5", "  stated:  test_suite.py:9"]


STATED_ELSEWHERE = """
from pathlib import Path
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements(Path("limits.txt")))
def test_it(drive, requirement, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive.check(requirement)
"""


def test_a_failure_names_the_file_of_its_requirement_wherever_the_test_has_gone(suite):
    folder = suite(test=STATED_ELSEWHERE)
    (folder.path / "limits.txt").write_text(f"# limits\n{RED}\n")
    run(folder).stdout.fnmatch_lines(["  stated:  limits.txt:2"])
