"""Waivers in pytest: a waived requirement that fails is an xfail until its date, and red with a word about it after."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from pytest_drive_robust.plugin.judging import BrokenRequirementError
from pytest_drive_robust.regression.waivers import Waivers


class WaivingPlugin:
    """Applies the waivers in every process that runs tests."""

    def __init__(self, waivers: Waivers) -> None:
        self._waivers = waivers

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Turn a waived failure into an xfail, which travels from workers; name a waiver that has expired."""
        error = call.excinfo.value if call.excinfo is not None else None
        waiver = None
        if isinstance(error, BrokenRequirementError):
            noted = {name: str(value) for name, value in item.user_properties}  # of `drive.check` what it noted last
            waiver = self._waivers.find(noted["drive_requirement"], item.nodeid, agent=noted["drive_agent"])
        holds = waiver is not None and self._waivers.holds(waiver)
        if waiver is not None and not holds and isinstance(error, BrokenRequirementError):
            error.msg = f"{error.msg}\n  the waiver has expired: {waiver.signature}"
        report = yield
        if waiver is not None and holds:
            report.outcome = "skipped"
            report.wasxfail = waiver.signature
            item.user_properties.append(("drive_waived", waiver.signature))
        return report
