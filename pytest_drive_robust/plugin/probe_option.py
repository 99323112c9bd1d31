"""`--drive-probe`: before the tests run, one clean episode is driven twice, and the run says whether that repeats."""

from __future__ import annotations

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.plugin.run_outputs import RunOutputs
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.repeatability import drive_twice, drives_compared
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.routes import resolve_routes


class ProbePlugin:
    """Probes in the one process that people look at, when `--drive-probe` was given."""

    def __init__(self, config: pytest.Config, options: RunOptions, outputs: RunOutputs) -> None:
        self._config = config
        self._options = options
        self._outputs = outputs

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Drive, tell at once, and keep it for the reports. With --collect-only and the like nothing is driven."""
        if any(self._config.getoption(name, False) for name in ("collectonly", "setupplan", "setuponly")):
            return
        sentence = self._sentence()
        self._outputs.note(sentence)
        reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None:
            reporter.write_line(f"drive-robust: {sentence}")

    def _sentence(self) -> str:
        options, registry = self._options, default_registry()
        try:
            scope = Scopes(options, registry, resolve_routes).of(MarkerOptions())
            found = drive_twice(
                registry,
                agent=scope.agent,
                simulator=options.simulator,
                options=SimulatorOptions(stuck_stop_s=options.stuck_stop_s),
                route=scope.routes[0],
                seed=scope.seeds[0],
            )
        except UsageError as error:  # a conftest.py that only the workers read may know the name
            return f"probe: not driven: {error}"
        return drives_compared(*found)
