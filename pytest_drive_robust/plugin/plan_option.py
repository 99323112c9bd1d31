"""`--drive-plan`: show which episodes the selected tests may need and drive nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.plugin.process_roles import is_controller
from pytest_drive_robust.plugin.terminal import is_terminal
from pytest_drive_robust.plugin.usage_errors import raise_as_pytests
from pytest_drive_robust.report.page import columns_of_screen
from pytest_drive_robust.report.plan_table import plan_text
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest, VerdictPlan
from pytest_drive_robust.store.base import EpisodeStore


def check_plan_alone(config: pytest.Config) -> None:
    """Raise `UsageError` where workers collect, so that this process knows no test."""
    if is_controller(config):
        raise UsageError("--drive-plan looks at the tests in one process: leave -n out, or add -n0.")


@dataclass(eq=False)
class PlanPlugin:
    """Shows the plan in place of running tests.

    `requests` are the episodes of the selected tests by key, `verdict_plans` what their verdicts read; their collection
    fills both. `executor` is the one that a run would drive with.
    """

    config: pytest.Config
    campaign: Campaign
    store: EpisodeStore
    requests: Mapping[str, EpisodeRequest]
    verdict_plans: Sequence[VerdictPlan]
    executor: Executor

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> bool:
        """Show the plan; no test runs."""
        reporter = self.config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None:
            try:
                self._take_finished()
            except UsageError as error:
                raise_as_pytests(error)
            likely, possible = self._needed()
            text = plan_text(
                self.requests.values(),
                self.store.get,
                likely=likely,
                possible=possible,
                slots=self.executor.slots,
                together=self.executor.together,
                colour=reporter.hasmarkup,
                width=columns_of_screen(is_terminal=is_terminal(reporter)),
            )
            reporter.section("drive-robust plan")
            reporter.write_line(text)
        return True

    def _take_finished(self) -> None:
        """Put what the executor keeps itself into the store of this run. Raises `UsageError`."""
        for key, request in self.requests.items():
            if (result := self.executor.finished(request)) is not None:
                self.store.put(key, result)

    def _needed(self) -> tuple[set[str], set[str]]:
        """Return the keys of the episodes that the verdicts probably take, and that they take at most."""
        likely: set[str] = set()
        possible: set[str] = set()
        for plan in self.verdict_plans:
            few, most = self.campaign.outlook(plan)
            likely.update(request.key for request in plan.requests(0, few))
            possible.update(request.key for request in plan.requests(0, most))
        return likely, possible
