"""`--drive-plan`: what is left to drive, as far as the stored episodes tell."""

from __future__ import annotations

import pytest

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route


@pytest.fixture
def plan(suite, pytester):
    """Write a suite of sixty routes; call with options to get the lines of its plan."""
    project = suite("DS under clean >= 40")
    save_routes([fake_route(str(number), length_m=9.0) for number in range(1, 61)], pytester.path / "routes.xml")

    def read(*options: str) -> list[str]:
        result = project.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence", "--drive-plan", *options)
        assert result.ret == 0
        return [line for line in result.outlines if line.strip()]

    return read


def test_a_plan_drives_nothing_and_says_what_the_verdict_probably_takes(plan, driven):
    *_, row, last, _ = plan()
    assert row.split() == ["steady", "clean", "60", "0", "60"]
    assert last.startswith("About ")
    assert "(at most 60: a verdict takes as many as it needs)" in last
    assert driven() == []


def test_where_the_verdict_is_in_nothing_is_left(plan, pytester, driven):
    pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence").assert_outcomes(passed=1)
    took = len(driven())
    assert 0 < took < 60
    *_, row, last, _ = plan()
    assert row.split() == ["steady", "clean", "60", str(took), "0"]
    assert last == "Every episode that the verdicts need is stored: nothing would be driven."


def test_another_rule_takes_what_it_takes_beyond_what_is_stored(plan, pytester, driven):
    pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence")
    took = len(driven())
    *_, row, last, _ = plan("--drive-verdict", "point")
    assert row.split() == ["steady", "clean", "60", str(took), str(60 - took)]
    assert last.startswith(f"{60 - took} episodes would be driven")


def test_a_suite_that_asks_for_nothing_has_an_empty_plan(suite):
    project = suite(test="def test_nothing():\n    pass\n")
    result = project.runpytest_inprocess("--drive-robust", "--drive-plan")
    assert "INTERNALERROR" not in "\n".join((*result.outlines, *result.errlines))
    assert "Every episode that the verdicts need is stored: nothing would be driven." in result.outlines


BODIES = """
from pytest_drive_robust import requirement

def test_first(drive):
    assert drive.rd("throttle 0.9") <= 0.3

def test_second(drive):
    drive.check(requirement("DS") >= 1)
"""


def test_a_plan_does_not_call_all_stored_what_it_cannot_know(suite):
    project = suite("DS under clean >= 40", test=BODIES)
    told = "Not counted is what tests without a requirement as a parameter ask for in their bodies: *_first and 1 more."
    first = project.runpytest_inprocess("--drive-robust", "--drive-plan")
    first.stdout.fnmatch_lines(["3 episodes would be driven, *", told])
    project.runpytest_inprocess("--drive-robust", "-k", "clean").assert_outcomes(passed=1)
    second = project.runpytest_inprocess("--drive-robust", "--drive-plan")
    second.stdout.fnmatch_lines(["Every episode of the requirements that are parameters is stored.", told])
    second.stdout.no_fnmatch_line("*nothing would be driven*")
