"""Marks tests that an error stopped while statements were left: what those would have asked `drive` is not judged."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from pytest_drive_robust.plugin.judging import Drive
from pytest_drive_robust.plugin.statements_left import has_statements_left
from pytest_drive_robust.plugin.verdict_errors import BODY_ENDED, BrokenRequirementError, NotJudgedError

STOPPED = "drive_robust_stopped"
"""The attribute of the report on a test that stopped with statements left: how often it had called `drive` by then."""


class StoppedTestsPlugin:
    """Marks the reports of stopped tests, in every process that runs tests."""

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, object, object]:
        """Note whether the body of the test has ended."""
        item.stash[BODY_ENDED] = False
        try:
            return (yield)
        finally:
            item.stash[BODY_ENDED] = True

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Say in our message, before pytest takes it into the report, that the test stopped; mark the report."""
        calls = _stopped_after(item, call)
        error = call.excinfo.value if call.excinfo is not None else None
        if calls and isinstance(error, (BrokenRequirementError, NotJudgedError)):
            _tell(error, calls)
        report = yield
        if calls:
            vars(report)[STOPPED] = calls  # a plain attribute: pytest-xdist sends it from workers
        return report


def _stopped_after(item: pytest.Item, call: pytest.CallInfo[None]) -> int:
    """Return how often a test had called `drive` when an error stopped it with statements left; 0 for other tests."""
    drive = getattr(item, "funcargs", {}).get("drive")
    if call.excinfo is None or not isinstance(drive, Drive):
        return 0
    if call.when == "setup":  # the whole body is left
        return drive.calls
    if call.when == "teardown" and not isinstance(call.excinfo.value, (BrokenRequirementError, NotJudgedError)):
        return 0
    in_subtest = not item.stash.get(BODY_ENDED, True)
    left = drive.calls and has_statements_left(item, call.excinfo.tb, in_subtest=in_subtest)
    return drive.calls if left else 0


def _tell(error: BrokenRequirementError | NotJudgedError, calls: int) -> None:
    """Add to the message that the test stopped, once: an error may leave a subtest and then the test."""
    told = f"\n  stopped: at call {calls} of drive in this test; what it states after that was not judged"
    if told not in str(error.msg):
        error.msg = f"{error.msg}{told}"
