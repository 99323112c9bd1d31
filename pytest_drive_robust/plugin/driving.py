"""Writes our failure messages into test reports, and closes simulators, in every process that runs tests."""

from __future__ import annotations

from collections.abc import Callable, Generator
from enum import Enum
from typing import TYPE_CHECKING, Any

import pytest

from pytest_drive_robust.plugin.fixtures import uses_drive
from pytest_drive_robust.plugin.judging import ONE_AT_A_TIME, Drive
from pytest_drive_robust.plugin.requirement_place import place_of
from pytest_drive_robust.plugin.skip_marks import may_fail_by, names_errors
from pytest_drive_robust.plugin.unjudged import ANSWERED, JUDGES_LATER, left_unjudged
from pytest_drive_robust.plugin.verdict_errors import (
    BODY_ENDED,
    RAISED,
    UNANSWERED,
    UNHEEDED,
    BrokenRequirementError,
    NotJudgedError,
    is_open,
)
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.runner.campaign import Campaign

if TYPE_CHECKING:
    from _pytest._code.code import TerminalRepr

NOT_JUDGED = "drive_robust_not_judged"
"""The attribute of a test report that counts as an error."""
BROKE = "drive_robust_broke"
"""The attribute of the report on a test that uses `drive` and broke: what it did not ask for by then is not judged."""
OWN_VERDICT = "drive_robust_own_verdict"
"""The attribute of the report on a test that asked `drive` and failed by its own `assert` or `pytest.fail`."""
MAY_FAIL = "drive_robust_may_fail"
"""The attribute of the report on a test that is expected to fail and whose inconclusive verdict may become a fail."""
_EXPECTED_TO_FAIL = ("[XPASS(strict)]", "Unexpected success")
"""What pytest calls a strict xfail, and a test of `unittest.expectedFailure`, that passes."""


class DrivingPlugin:
    """Reports on tests that drive.

    `last_words()` returns (episode, printed text) of the episodes that broke since the last call.
    """

    def __init__(self, campaign: Campaign, last_words: Callable[[], tuple[tuple[str, str], ...]]) -> None:
        self._campaign = campaign
        self._last_words = last_words

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Forget the notes of an earlier attempt: a plugin that runs failed tests again keeps the item."""
        item.stash[UNANSWERED] = []
        item.stash[RAISED] = []
        item.stash[ANSWERED] = set()
        item.stash[JUDGES_LATER] = False
        item.user_properties[:] = [
            (name, value) for name, value in item.user_properties if not name.startswith("drive_")
        ]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Put the first line of our message into the short summary, and mark a test that could not be judged.

        An expected failure (xfail) is expected of the agent: xfail hides no error that left a call of `drive` without
        an answer, unless it names that error, and an inconclusive verdict breaks no strict xfail.
        """
        report = yield
        error = _error_of(item, call)
        raised: list[BaseException] = item.stash.get(RAISED, [])
        report.user_properties = [(name, _plain(value)) for name, value in report.user_properties]
        passed = call.excinfo is None and (not report.failed or _passed_unexpectedly(report))
        if error is None and passed and item.stash.get(BODY_ENDED, True):  # else it is the report of a subtest
            error = left_unjudged(item, call.when)
            if error is not None:
                vars(report)[BROKE] = True  # a plain attribute: pytest-xdist sends it from workers
        if error is None and report.when == "call" and report.passed:
            report.user_properties += [(UNHEEDED, _first_line(told)) for told in raised[:1]]
        item.stash[RAISED] = [told for told in raised if told is not error]  # a subtest reported it
        if _is_unanswered(item, error) and (passed or _is_hidden(item, report, error)):
            vars(report).pop("wasxfail", None)
            report.outcome = "failed"
            if error is not None and (call.excinfo is None or call.excinfo.value is not error):
                report.longrepr = _shown(item, error)
        elif is_open(report) and _passed_unexpectedly(report):
            report.outcome, report.longrepr = "passed", None
            vars(report)[MAY_FAIL] = _may_break_a_requirement(item)
        if report.failed:
            self._complete(report, item, error)
        return report

    def _complete(self, report: pytest.TestReport, item: pytest.Item, error: BaseException | None) -> None:
        """Mark the report of a failed test, and let it begin with our message, if that is what the test failed by."""
        if _broke(item, report, error):
            vars(report)[BROKE] = True
        if _is_unanswered(item, error):
            vars(report)[NOT_JUDGED] = True
        if not isinstance(error, (BrokenRequirementError, NotJudgedError)):
            is_own = _is_verdict(error) and not _is_unanswered(item, error)
            vars(report)[OWN_VERDICT] = is_own and report.when == "call" and _asked_drive(item)
            return
        crash = getattr(report.longrepr, "reprcrash", None)
        if crash is not None:
            crash.message = _first_line(error)
        place = place_of(item, error.what if isinstance(error, NotJudgedError) else error.verdict.requirement)
        if place is not None:
            report.location = (place[0], place[1] - 1, report.location[2])  # pytest counts lines from 0
        report.sections += [(legible(f"printed by {episode}"), legible(text)) for episode, text in self._last_words()]

    def pytest_runtest_logfinish(self) -> None:
        """Store the episodes that have ended: another worker may wait for them, and the next test may drive nothing."""
        with ONE_AT_A_TIME:  # a thread of the test may still ask for episodes
            self._campaign.scheduler.collect()

    def pytest_keyboard_interrupt(self) -> None:
        """Cut off the episodes under way: a pytest-xdist worker whose controller was killed gets this hook call.

        The worker's report then fails, and pytest ends the worker without calling `pytest_unconfigure`.
        """
        self._campaign.scheduler.close()

    def pytest_unconfigure(self) -> None:
        """Close simulators."""
        self._campaign.scheduler.close()


def _first_line(error: BaseException) -> str:
    """Return the first line of our error message, for a report."""
    return str(error).partition("   (")[0].partition("\n")[0]


def _error_of(item: pytest.Item, call: pytest.CallInfo[None]) -> BaseException | None:
    """Return the error that a test raised; `unittest.expectedFailure` replaces ours, which is then read from `item`."""
    if _is_expected_by_unittest(item) and call.when == "call":
        unanswered: list[BaseException] = item.stash.get(UNANSWERED, [])
        return unanswered[-1] if unanswered else None
    return call.excinfo.value if call.excinfo is not None else None


def _is_unanswered(item: pytest.Item, error: BaseException | None) -> bool:
    """Return True for an error that left a call of `drive` without an answer, or a test without a judgement."""
    return isinstance(error, NotJudgedError) or any(error is told for told in item.stash.get(UNANSWERED, []))


def _is_hidden(item: pytest.Item, report: pytest.TestReport, error: BaseException | None) -> bool:
    """Return True where a test is expected to fail, but not by this error: nobody named its class."""
    if not hasattr(report, "wasxfail"):
        return False
    return isinstance(error, NotJudgedError) or _is_expected_by_unittest(item) or not names_errors(item)


def _passed_unexpectedly(report: pytest.TestReport) -> bool:
    """Return True for a test that is expected to fail and that passed, strict or not."""
    if report.passed:
        return hasattr(report, "wasxfail")
    return report.failed and str(report.longrepr).startswith(_EXPECTED_TO_FAIL)


def _is_expected_by_unittest(item: pytest.Item) -> bool:
    return bool(getattr(getattr(item, "obj", None), "__unittest_expecting_failure__", False))


def _may_break_a_requirement(item: pytest.Item) -> bool:
    """Return whether a test that is expected to fail may do so by a broken requirement."""
    verdict: Any = None  # there is none: what counts is the class of the error
    return _is_expected_by_unittest(item) or may_fail_by(item, BrokenRequirementError("a broken requirement", verdict))


def _broke(item: pytest.Item, report: pytest.TestReport, error: BaseException | None) -> bool:
    """Return True for a failed test that uses `drive` and broke before its end, for example in another fixture.

    A test that has asked for something did not break when it failed by `assert`, `pytest.fail` or one of our errors:
    that is its own verdict.
    """
    if not uses_drive(item) or "drive" not in getattr(item, "fixturenames", ()):
        return False
    drive = getattr(item, "funcargs", {}).get("drive")
    if drive is None:
        return report.when == "setup"
    is_verdict = report.when == "teardown" or error is None or _is_verdict(error)
    return isinstance(drive, Drive) and not (is_verdict and _asked_drive(item))


def _is_verdict(error: BaseException | None) -> bool:
    """Return True for an error of `assert`, of `pytest.fail`, or of ours: a test fails by it on purpose."""
    return isinstance(error, (AssertionError, pytest.fail.Exception))


def _asked_drive(item: pytest.Item) -> bool:
    drive = getattr(item, "funcargs", {}).get("drive")
    return isinstance(drive, Drive) and drive.was_asked


def _shown(item: pytest.Item, error: BaseException) -> str | TerminalRepr:
    """Return what pytest shows for an error that the test did not raise itself, placed at the test's first line."""
    try:
        raise error
    except BaseException:
        shown = item.repr_failure(pytest.ExceptionInfo.from_current())
    crash = getattr(shown, "reprcrash", None)
    if crash is not None:
        crash.path, crash.lineno = str(item.path), (item.location[1] or 0) + 1
    return shown


def _plain(value: object) -> object:
    """Return a test property as a value of Python's own classes: pytest-xdist sends no other from a worker.

    `drive.ds(...)` is a subclass of float, `result.outcome` of str and `drive.largest(...)` of tuple.
    """
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, float):
        return float(value)
    if type(value) in (list, tuple):
        return [_plain(item) for item in value]  # type: ignore[attr-defined]
    if type(value) is dict:
        return {_plain(key): _plain(item) for key, item in value.items()}
    return str(value) if type(value).__module__.startswith("pytest_drive_robust.") else value
