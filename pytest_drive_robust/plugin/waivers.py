"""Applies waivers: a waived requirement that fails is an xfail until the waiver's date, and a named failure later."""

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
        """Forget the waivers of an earlier attempt: a plugin that runs failed tests again keeps the item."""
        item.stash[WAIVED] = []

    @pytest.hookimpl(specname="pytest_runtest_makereport")
    def pytest_name_expired_waiver(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        """Add an expired waiver to the error of a test or a TestCase, before pytest makes the report."""
        error = call.excinfo.value if call.excinfo is not None else None
        if not isinstance(error, BrokenRequirementError):
            return
        verdict = error.verdict
        waiver = self._waivers.find(str(verdict.requirement), item.nodeid, agent=verdict.agent)
        if waiver is not None:  # expired: a failure under a waiver that holds is not raised
            error.msg = f"{error.msg}\n  the waiver has expired: {waiver.signature}"

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Turn a test or subtest that broke only waived requirements into an xfail.

        pytest-xdist sends the xfail from workers. A test that is marked as an expected failure becomes an xfail, too.
        """
        report = yield
        if call.when == "setup":  # the test's own report takes what a fixture found broken
            return report
        signed: list[str] = item.stash.get(WAIVED, [])
        waived = "; ".join(dict.fromkeys(signed))
        item.stash[WAIVED] = []
        if waived and call.excinfo is None:
            report.outcome = "skipped"
            report.wasxfail = waived
            item.user_properties.append(("drive_waived", waived))
        return report
