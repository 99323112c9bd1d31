"""Waivers in pytest: a waived requirement that fails is an xfail until its date, and red with a word about it after."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from pytest_drive_robust.plugin.verdict_errors import BrokenRequirementError
from pytest_drive_robust.regression.waivers import Waiver, Waivers


class WaivingPlugin:
    """Applies the waivers in every process that runs tests."""

    def __init__(self, waivers: Waivers) -> None:
        self._waivers = waivers

    @pytest.hookimpl(specname="pytest_runtest_makereport")
    def pytest_name_expired_waiver(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        """Name a waiver that has expired, before pytest writes down what a test, or a TestCase, raised."""
        waiver = self._waiver_of(item, call)
        if waiver is not None and not self._waivers.holds(waiver) and call.excinfo is not None:
            error = call.excinfo.value
            error.msg = f"{error.msg}\n  the waiver has expired: {waiver.signature}"  # type: ignore[attr-defined]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Turn a waived failure into an xfail, which travels from workers."""
        report = yield
        waiver = self._waiver_of(item, call)  # after pytest, which knows only then what a TestCase raised
        if waiver is not None and self._waivers.holds(waiver):
            report.outcome = "skipped"
            report.wasxfail = waiver.signature
            item.user_properties.append(("drive_waived", waiver.signature))
        return report

    def _waiver_of(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Waiver | None:
        """Return the waiver of the requirement that a test found broken, held or expired."""
        error = call.excinfo.value if call.excinfo is not None else None
        if not isinstance(error, BrokenRequirementError):
            return None
        verdict = error.verdict
        return self._waivers.find(str(verdict.requirement), item.nodeid, agent=verdict.agent)
