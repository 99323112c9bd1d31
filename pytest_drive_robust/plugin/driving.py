"""In every process that runs tests: failures in our words, and simulators closed at the end."""

from __future__ import annotations

from collections.abc import Callable, Generator

import pytest

from pytest_drive_robust.plugin.judging import BrokenRequirementError, NotJudgedError
from pytest_drive_robust.plugin.requirement_place import place_of
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.runner.campaign import Campaign

NOT_JUDGED = "drive_robust_not_judged"
"""The attribute of a test report that counts as an error."""


class DrivingPlugin:
    """Reports on tests that drive. `last_words()` are what broken episodes printed since it was asked last."""

    def __init__(self, campaign: Campaign, last_words: Callable[[], tuple[tuple[str, str], ...]]) -> None:
        self._campaign = campaign
        self._last_words = last_words

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Put our message in one line into the short summary, and mark what could not be judged."""
        report = yield
        error = call.excinfo.value if call.excinfo is not None else None
        if report.failed and isinstance(error, (BrokenRequirementError, NotJudgedError)):
            crash = getattr(report.longrepr, "reprcrash", None)
            if crash is not None:
                crash.message = str(error).partition("   (")[0].partition("\n")[0]
            place = place_of(item)
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
        self._campaign.scheduler.collect()

    def pytest_keyboard_interrupt(self) -> None:
        """Cut off what is under way: a worker of pytest-xdist whose controller was killed hears of it like this.

        What it tries to report then fails, and pytest leaves it without unconfiguring.
        """
        self._campaign.scheduler.close()

    def pytest_unconfigure(self) -> None:
        """Close simulators."""
        self._campaign.scheduler.close()
