"""`--drive-probe`: before the tests run, one clean episode is driven twice, and the run says whether that repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.plugin.run_owner import RunOwner

__all__ = ["ProbePlugin"]


class ProbePlugin:
    """In the one process that people look at, when `--drive-probe` was given."""

    def __init__(self, config: pytest.Config, settings: RunOptions, owner: RunOwner) -> None:
        self._config = config
        self._settings = settings
        self._owner = owner

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Drive, tell at once, and keep it for the reports. With --collect-only and the like nothing is driven."""
        if any(self._config.getoption(name, False) for name in ("collectonly", "setupplan", "setuponly")):
            return
        sentence = self._sentence()
        self._owner.note(sentence)
        reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None:
            reporter.write_line(f"drive-robust: {sentence}")

    def _sentence(self) -> str:
        from pytest_drive_robust.options.marker import MarkerOptions
        from pytest_drive_robust.registry.registry import default_registry
        from pytest_drive_robust.runner.routes import resolve_routes
        from pytest_drive_robust.runner.scopes import Scopes
        from pytest_drive_robust.runner.search.repeatability import probe
        from pytest_drive_robust.simulators.base import SimulatorOptions

        settings, registry = self._settings, default_registry()
        try:
            scope = Scopes(settings, registry, resolve_routes).of(MarkerOptions())
            found = probe(
                registry,
                agent=scope.agent,
                simulator=settings.simulator,
                options=SimulatorOptions(stuck_stop_s=settings.stuck_stop_s),
                route=scope.routes[0],
                seed=scope.seeds[0],
            )
        except UsageError as error:  # a conftest.py that only the workers read may know the name
            return f"probe: not driven: {error}"
        return str(found)
