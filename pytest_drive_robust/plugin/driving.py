"""In every process that runs tests: failures in our words, and simulators closed at the end."""

from __future__ import annotations

from collections.abc import Callable, Generator
from enum import Enum
from typing import TYPE_CHECKING

import pytest

from pytest_drive_robust.plugin.fixtures import uses_drive
from pytest_drive_robust.plugin.judging import ONE_AT_A_TIME, Drive
from pytest_drive_robust.plugin.requirement_place import place_of
from pytest_drive_robust.plugin.verdict_errors import (
    NOT_JUDGED_ERROR,
    RAISED,
    UNHEEDED,
    BrokenRequirementError,
    NotJudgedError,
    is_open,
)
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.verdict.requirement import Requirement

if TYPE_CHECKING:
    from _pytest._code.code import TerminalRepr

NOT_JUDGED = "drive_robust_not_judged"
"""The attribute of a test report that counts as an error."""
BROKE_UNASKED = "drive_robust_broke_unasked"
"""The attribute of the report on a test that broke before it asked `drive` for anything."""
_EXPECTED_TO_FAIL = ("[XPASS(strict)]", "Unexpected success")
"""What pytest calls a strict xfail, and a test of `unittest.expectedFailure`, that passes."""


class DrivingPlugin:
    """Reports on tests that drive. `last_words()` are what broken episodes printed since it was asked last."""

    def __init__(self, campaign: Campaign, last_words: Callable[[], tuple[tuple[str, str], ...]]) -> None:
        self._campaign = campaign
        self._last_words = last_words

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Forget what an attempt before this one noted: a plugin that runs failed tests again keeps the item."""
        item.stash[NOT_JUDGED_ERROR] = None
        item.stash[RAISED] = []
        item.user_properties[:] = [
            (name, value) for name, value in item.user_properties if not name.startswith("drive_")
        ]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Put our message in one line into the short summary, and mark what could not be judged.

        Who expects a test to fail expects it of the agent: that hides no error, and an open verdict does not deny it.
        """
        report = yield
        error = _error_of(item, call)
        raised: list[BaseException] = item.stash.get(RAISED, [])
        report.user_properties = [(name, _plain(value)) for name, value in report.user_properties]
        if error is None and report.when == "call" and report.passed:
            error = _forgotten(item)
            report.user_properties += [(UNHEEDED, _first_line(told)) for told in raised[:1]]
        item.stash[RAISED] = [told for told in raised if told is not error]  # a subtest reported it
        if isinstance(error, NotJudgedError) and (report.passed or hasattr(report, "wasxfail")):
            vars(report).pop("wasxfail", None)
            report.outcome = "failed"
            if call.excinfo is None or call.excinfo.value is not error:
                report.longrepr = _shown(item, error)
        elif report.failed and str(report.longrepr).startswith(_EXPECTED_TO_FAIL) and is_open(report):
            report.outcome, report.longrepr = "passed", None
        if report.failed and _is_unasked(item, report):
            vars(report)[BROKE_UNASKED] = True  # it travels, too
        if report.failed and isinstance(error, (BrokenRequirementError, NotJudgedError)):
            crash = getattr(report.longrepr, "reprcrash", None)
            if crash is not None:
                crash.message = _first_line(error)
            stated = error.what if isinstance(error, NotJudgedError) else error.verdict.requirement
            place = place_of(item, stated)
            if place is not None:
                report.location = (place[0], place[1] - 1, report.location[2])  # from 0
            if isinstance(error, NotJudgedError):
                vars(report)[NOT_JUDGED] = True  # a plain attribute: it travels from workers
            report.sections += [
                (legible(f"printed by {episode}"), legible(text)) for episode, text in self._last_words()
            ]
        return report

    def pytest_runtest_logfinish(self) -> None:
        """Store what ended meanwhile: the next test may be long and drive nothing, and another worker may wait."""
        with ONE_AT_A_TIME:  # a thread of the test may be there still
            self._campaign.scheduler.collect()

    def pytest_keyboard_interrupt(self) -> None:
        """Cut off what is under way: a worker of pytest-xdist whose controller was killed hears of it like this.

        What it tries to report then fails, and pytest leaves it without unconfiguring.
        """
        self._campaign.scheduler.close()

    def pytest_unconfigure(self) -> None:
        """Close simulators."""
        self._campaign.scheduler.close()


def _first_line(error: BaseException) -> str:
    """Return what a report says of our error in one line."""
    return str(error).partition("   (")[0].partition("\n")[0]


def _error_of(item: pytest.Item, call: pytest.CallInfo[None]) -> BaseException | None:
    """Return what a test raised; `unittest.expectedFailure` has put an error of its own in the place of ours."""
    if getattr(getattr(item, "obj", None), "__unittest_expecting_failure__", False) and call.when == "call":
        return item.stash.get(NOT_JUDGED_ERROR, None)
    return call.excinfo.value if call.excinfo is not None else None


def _forgotten(item: pytest.Item) -> NotJudgedError | None:
    """Return what to say of a test that has a requirement as its parameter and asked `drive` for nothing: no pass."""
    drive, callspec = getattr(item, "funcargs", {}).get("drive"), getattr(item, "callspec", None)
    if not isinstance(drive, Drive) or drive.was_asked or callspec is None:
        return None
    given = next((value for value in callspec.params.values() if isinstance(value, Requirement)), None)
    if given is None:
        return None
    return NotJudgedError(given, "the test ended without it. Call drive.check(requirement), or skip the test.")


def _is_unasked(item: pytest.Item, report: pytest.TestReport) -> bool:
    """Return True where a test that has `drive` has not asked it for anything, as its own fixtures may break."""
    if not uses_drive(item) or "drive" not in getattr(item, "fixturenames", ()):
        return False
    drive = getattr(item, "funcargs", {}).get("drive")
    return report.when == "setup" if drive is None else isinstance(drive, Drive) and not drive.was_asked


def _shown(item: pytest.Item, error: NotJudgedError) -> str | TerminalRepr:
    """Return what pytest shows of an error that the test itself did not raise: it stands where the test begins."""
    try:
        raise error
    except NotJudgedError:
        shown = item.repr_failure(pytest.ExceptionInfo.from_current())
    crash = getattr(shown, "reprcrash", None)
    if crash is not None:
        crash.path, crash.lineno = str(item.path), (item.location[1] or 0) + 1
    return shown


def _plain(value: object) -> object:
    """Return a property of a test as a value that travels from workers, which only Python's own classes do.

    `drive.ds(...)` is a float, `result.outcome` a str and `drive.largest(...)` a tuple of a class of ours.
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
