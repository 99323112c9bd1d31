"""Plugins that run a failed test again: an attempt that others follow is no error, and leaves nothing behind."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

RERUN = """
from _pytest.runner import runtestprotocol


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for attempt in (1, 2):
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        again = attempt == 1 and any(report.failed for report in reports)
        for report in reports:
            if again and report.failed:
                report.outcome = "rerun"
            item.ihook.pytest_runtest_logreport(report=report)
            if again and report.outcome == "rerun":
                break
        if not again:
            break
        item._initrequest()
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_report_teststatus(report):
    return ("rerun", "R", ("RERUN", {"yellow": True})) if report.outcome == "rerun" else None
"""
"""As pytest-rerunfailures does it, with one attempt more."""
ONCE_UNKNOWN = """
from pytest_drive_robust import requirements

(WEAK,) = requirements("DS under throttle 0.3 >= 20")
attempts = []

def test_it(drive):
    attempts.append(1)
    if len(attempts) == 1:
        drive.largest(type(WEAK.setting.perturbations[0]), metric="DSS")
    drive.check(WEAK)
"""

processes = pytest.mark.parametrize("workers", [(), ("-n1",)], ids=["one-process", "one-worker"])


@processes
def test_a_test_that_is_judged_when_it_runs_again_passes_and_notes_that_only(suite, workers):
    folder = suite(test=ONCE_UNKNOWN, conftest=RERUN)
    result = folder.runpytest_inprocess("--drive-robust", "--junitxml=junit.xml", "-o", "junit_family=xunit1", *workers)
    assert result.ret == 0
    assert result.parseoutcomes() == {"passed": 1, "rerun": 1}
    (case,) = ElementTree.parse(folder.path / "junit.xml").iter("testcase")
    assert [item.get("value") for item in case.iter("property") if item.get("name") == "drive_verdict"] == ["pass"]


def test_an_episode_that_broke_in_the_simulator_is_not_driven_again_by_a_test_that_runs_again(suite, driven):
    conftest = """
class OnceBroken(LoggedSimulator):
    def step(self, *args, **kwargs):
        healed = LOG.with_name("healed")
        if not healed.exists():
            raise RuntimeError("no map today")
        return super().step(*args, **kwargs)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("once-broken", lambda options: OnceBroken(replace(options, tick_cap=60)))


def pytest_runtest_logreport(report):
    LOG.with_name("healed").touch()
"""
    folder = suite("DS under clean >= 90", conftest=RERUN + conftest)
    args = ("--drive-robust", "--drive-sim", "once-broken")
    result = folder.runpytest_inprocess(*args)
    assert result.ret == 1
    assert result.parseoutcomes() == {"errors": 1, "rerun": 1}
    assert driven() == sorted(["1 0", "2 0", "3 0"] * 3), "what breaks is driven thrice and never again by this run"
    assert folder.runpytest_inprocess(*args).ret == 0
    assert driven() == sorted(["1 0", "2 0", "3 0"] * 4)
