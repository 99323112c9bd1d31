"""Waivers in pytest: a waived requirement that fails is an xfail until its date, and red with a word about it after."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from pytest_drive_robust.plugin.verdict_errors import WAIVED, BrokenRequirementError
from pytest_drive_robust.regression.waivers import Waivers


class WaivingPlugin:
    """Applies the waivers in every process that runs tests."""

    def __init__(self, waivers: Waivers) -> None:
        self._waivers = waivers

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Forget what an attempt before this one noted: a plugin that runs failed tests again keeps the item."""
        item.stash[WAIVED] = []

    @pytest.hookimpl(specname="pytest_runtest_makereport")
    def pytest_name_expired_waiver(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        """Name a waiver that has expired, before pytest writes down what a test, or a TestCase, raised."""
        error = call.excinfo.value if call.excinfo is not None else None
        if not isinstance(error, BrokenRequirementError):
            return
        verdict = error.verdict
        waiver = self._waivers.find(str(verdict.requirement), item.nodeid, agent=verdict.agent)
        if waiver is not None:  # one that holds is not raised
            error.msg = f"{error.msg}\n  the waiver has expired: {waiver.signature}"

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Turn a test, or a subtest, in which nothing but what is waived was broken into an xfail.

        That travels from workers. Who expects the test to fail is answered, too.
        """
        report = yield
        if call.when == "setup":  # what a fixture found broken is told of by the test that goes on
            return report
        signed: list[str] = item.stash.get(WAIVED, [])
        waived = "; ".join(dict.fromkeys(signed))
        item.stash[WAIVED] = []
        if waived and call.excinfo is None:
            report.outcome = "skipped"
            report.wasxfail = waived
            item.user_properties.append(("drive_waived", waived))
        return report
