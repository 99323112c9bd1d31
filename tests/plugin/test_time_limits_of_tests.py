"""A plugin such as pytest-timeout cuts off a test that waits for episodes: nothing is judged, nobody is to blame."""

from __future__ import annotations

import json

import pytest

CUT_OFF = """
import signal


class Interrupted(LoggedSimulator):
    def step(self, control):
        signal.raise_signal(signal.SIGALRM)
        return super().step(control)


def pytest_runtest_setup(item):
    signal.signal(signal.SIGALRM, lambda *_: pytest.fail("Timeout (>3.0s) from pytest-timeout."))


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("interrupted", lambda options: Interrupted(replace(options, tick_cap=60)))
"""
"""As pytest-timeout does it, in the first tick of each episode."""
TESTS = """
import pytest
from pytest_drive_robust import requirements

(REQUIREMENT,) = requirements("DS under clean >= 1")


def test_judged(drive):
    drive.check(REQUIREMENT)


@pytest.mark.xfail(reason="known")
def test_expected_to_fail(drive):
    drive.check(REQUIREMENT)


def test_measured(drive):
    assert drive.ds("clean") >= 1
"""


@pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])
def test_a_test_that_is_cut_off_is_an_error_even_where_a_failure_is_expected(suite, workers):
    folder = suite(test=TESTS, conftest=CUT_OFF)
    result = folder.runpytest_inprocess("--drive-robust", "--drive-sim=interrupted", "--drive-json=run.json", *workers)
    assert result.ret == 1
    result.assert_outcomes(errors=3)
    told = result.stdout.str()
    assert told.count("the test was cut off: Timeout (>3.0s) from pytest-timeout. Finished episodes are kept") == 3
    assert "ERROR: not judged: DS under clean >= 1" in told
    assert "failed by its own assert" not in told
    verdicts = json.loads((folder.path / "run.json").read_text())["requirements"]
    assert {(row["verdict"], row["message"]) for row in verdicts} == {
        ("error", "Failed: Timeout (>3.0s) from pytest-timeout.")
    }
