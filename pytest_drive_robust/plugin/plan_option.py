"""`--drive-plan`: show which episodes the selected tests may need and drive nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.report.plan_table import plan_text
from pytest_drive_robust.runner.plan import EpisodeRequest, Reading
from pytest_drive_robust.store.base import EpisodeStore


def check_plan_alone(config: pytest.Config) -> None:
    """Raise `UsageError` where workers collect, so that this process knows no test."""
    if config.getoption("dist", "no") != "no":
        raise UsageError("--drive-plan looks at the tests in one process: leave -n out, or add -n0.")


class PlanPlugin:
    """Shows the plan in place of running tests.

    `requests` are the episodes of the selected tests by key, `readings` what their verdicts read; both are filled by
    their collection. `slots` is how many episodes a run would drive at a time.
    """

    def __init__(
        self,
        config: pytest.Config,
        store: EpisodeStore,
        requests: Mapping[str, EpisodeRequest],
        readings: Sequence[Reading],
        *,
        slots: int,
    ) -> None:
        self._config = config
        self._store = store
        self._slots = slots
        self._requests = requests
        self._readings = readings

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> bool:
        """Show the plan; no test runs."""
        reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None:
            likely = {request.key for reading in self._readings for request in reading.likely}
            text = plan_text(
                self._requests.values(), self._store.get, likely=likely, slots=self._slots, colour=reporter.hasmarkup
            )
            reporter.section("drive-robust plan")
            reporter.write_line(text)
        return True
