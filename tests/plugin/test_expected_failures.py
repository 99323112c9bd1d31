"""Tests that are expected to fail: the agent is, not the simulator, and an open verdict is neither pass nor fail."""

from __future__ import annotations

import pytest
from suite_runs import processes

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

RED = "DS under throttle 0.3 >= 60"
GREEN = "DS under clean >= 1"
OPEN = "DS under throttle 0.5 >= 57"
TEST = """
import unittest
import pytest
from pytest_drive_robust import requirements

(REQUIREMENT,) = requirements("{sentence}")

@pytest.mark.xfail(strict={strict}, reason="known")
def test_marked(drive):
    drive.check(REQUIREMENT)

class TestOld(unittest.TestCase):
    @pytest.fixture(autouse=True)
    def _drive(self, drive):
        self.drive = drive

    @unittest.expectedFailure
    def test_decorated(self):
        self.drive.check(REQUIREMENT)
"""


def run(suite, sentence, *args, strict=False):
    folder = suite(test=TEST.format(sentence=sentence, strict=strict))
    return folder.runpytest_inprocess("--drive-robust", "-ra", *args)


@processes
def test_a_simulator_that_breaks_is_an_error_where_a_failure_is_expected(suite, workers):
    result = run(suite, RED, "--drive-sim", "broken", *workers)
    assert result.ret == 1
    result.assert_outcomes(errors=2)
    result.stdout.fnmatch_lines("ERROR *test_marked - ERROR: not judged: DS under throttle 0.3*")
    told = (
        " - ERROR: not judged: DS under throttle 0.3" if pytest.version_tuple >= (8, 2) else ""
    )  # older ones leave it out
    result.stdout.fnmatch_lines(f"ERROR *TestOld::test_decorated{told}*")
    result.stdout.fnmatch_lines("*the simulation raised RuntimeError: no map*")


@pytest.mark.parametrize("kind", ["SimulationError", "DriveRobustError", "ValueError", "SystemExit"])
def test_a_metric_that_breaks_is_an_error_where_a_failure_is_expected_whatever_it_raises(suite, kind):
    metric = f"""

_register = pytest_drive_robust_register


def bumps(results):
    from pytest_drive_robust.errors import DriveRobustError, SimulationError
    raise {kind}("nothing was recorded")


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_metric("bumps", bumps)
"""
    test = TEST.format(sentence="bumps under clean <= 3", strict=False).partition("class TestOld")[0]
    result = suite(test=test, conftest=metric).runpytest_inprocess("--drive-robust")
    assert result.ret == 1
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*nothing was recorded*"])


@pytest.mark.parametrize(
    ("how", "outcome"),
    [
        ("strict=False", "errors"),
        ("raises=TypeError", "xfailed"),
        ("raises=(ValueError, Exception)", "xfailed"),
        ("raises=ValueError", "errors"),
    ],
)
def test_an_error_that_is_not_ours_is_expected_only_where_it_is_named(suite, how, outcome):
    test = f"""
import pytest

@pytest.mark.xfail({how})
def test_marked(drive):
    drive.check("DS under clean >= 1")
"""
    result = suite(test=test).runpytest_inprocess("--drive-robust")
    assert result.ret == 1  # and where it is expected, no episode was driven
    result.assert_outcomes(**{outcome: 1})


@processes
def test_a_bug_of_ours_is_an_error_where_a_failure_is_expected(suite, workers):
    bug = """

def decide(*given):
    raise TypeError("a bug of ours")


@pytest.fixture(autouse=True)
def bug(monkeypatch):
    from pytest_drive_robust.runner.campaign import Campaign
    monkeypatch.setattr(Campaign, "decide", decide)
"""
    folder = suite(test=TEST.format(sentence=RED, strict=False), conftest=bug)
    result = folder.runpytest_inprocess("--drive-robust", *workers)
    assert result.ret == 1
    result.assert_outcomes(errors=2)
    result.stdout.fnmatch_lines(["*TypeError: a bug of ours"])


@processes
@pytest.mark.parametrize("strict", [False, True])
def test_a_requirement_that_is_broken_stays_expected(suite, strict, workers):
    result = run(suite, RED, *workers, strict=strict)
    assert result.ret == 0
    result.assert_outcomes(xfailed=2)


@processes
@pytest.mark.parametrize("strict", [False, True])
def test_an_open_verdict_is_a_warning_and_no_pass_that_nobody_expected(suite, strict, workers):
    result = run(suite, OPEN, "--drive-verdict", "evidence", *workers, strict=strict)
    assert result.ret == 0
    assert result.parseoutcomes() == {"inconclusive": 2}


def test_a_requirement_that_holds_is_still_a_pass_that_nobody_expected(suite):
    result = run(suite, GREEN, strict=True)
    assert result.ret == 1
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines("*XPASS(strict)*")
    result.stdout.fnmatch_lines("*Unexpected success*")


@pytest.mark.parametrize(
    ("mode", "outcome", "code"), [("warn", "inconclusive", 0), ("skip", "skipped", 0), ("fail", "failed", 1)]
)
def test_no_smallest_failure_is_an_open_verdict_where_the_whole_one_is_open(suite, mode, outcome, code):
    folder = suite(
        test="""
from pytest_drive_robust import requirements

def test_it(drive):
    assert drive.minimal(requirements("RD under throttle 0.9 <= 0.30")[0]) is None
"""
    )
    save_routes([fake_route("1", length_m=900.0)], folder.path / "routes.xml")  # so long that nothing can be lost
    result = folder.runpytest_inprocess("--drive-robust", f"--drive-inconclusive={mode}", "-rs")
    assert result.ret == code
    assert result.parseoutcomes() == {outcome: 1}


@pytest.mark.skipif(not hasattr(pytest, "Subtests"), reason="subtests come with pytest 9")
def test_a_subtest_that_passes_after_an_open_one_is_not_open(suite):
    folder = suite(
        test=f"""
from pytest_drive_robust import requirements

def test_both(drive, subtests):
    for stated in requirements("{OPEN}\\n{GREEN}"):
        with subtests.test(str(stated)):
            drive.check(stated)
"""
    )
    result = folder.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence", "-v")
    assert result.ret == 0
    assert result.parseoutcomes()["inconclusive"] == 1
    result.stdout.fnmatch_lines([f"*::test_both SUBPASSED*{OPEN}*", f"*::test_both SUBPASSED*{GREEN}*"])
    result.stdout.fnmatch_lines("*::test_both INCONCLUSIVE*")
