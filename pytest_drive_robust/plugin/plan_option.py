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
    """Raise `UsageError` under `pytest -n`: workers collect the tests, so this process knows none."""
    if is_controller(config):
        raise UsageError("--drive-plan looks at the tests in one process: leave -n out, or add -n0.")


@dataclass(eq=False)
class PlanPlugin:
    """Shows the plan in place of running tests.

    `requests` holds the episodes of the selected tests by key, `verdict_plans` the episodes that each verdict reads,
    `unplanned` the tests whose episodes are not known; `CollectionPlugin` fills all three. `executor` is the executor
    that a run would use.
    """

    config: pytest.Config
    campaign: Campaign
    store: EpisodeStore
    requests: Mapping[str, EpisodeRequest]
    verdict_plans: Sequence[VerdictPlan]
    unplanned: Sequence[str]
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
                unplanned=self.unplanned,
                slots=self.executor.slots,
                together=self.executor.together,
                colour=reporter.hasmarkup,
                width=columns_of_screen(is_terminal=is_terminal(reporter)),
            )
            reporter.section("drive-robust plan")
            reporter.write_line(text)
        return True

    def _take_finished(self) -> None:
        """Copy the finished episodes that the executor keeps itself into the run's store. Raises `UsageError`."""
        for key, request in self.requests.items():
            if (result := self.executor.finished(request)) is not None:
                self.store.put(key, result)

    def _needed(self) -> tuple[set[str], set[str]]:
        """Return two sets of episode keys: those that the verdicts probably read, and those that they may read."""
        likely: set[str] = set()
        possible: set[str] = set()
        for plan in self.verdict_plans:
            few, most = self.campaign.outlook(plan)
            likely.update(request.key for request in plan.requests(0, few))
            possible.update(request.key for request in plan.requests(0, most))
        return likely, possible
