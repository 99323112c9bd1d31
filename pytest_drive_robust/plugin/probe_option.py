"""`--drive-probe`: drives one clean episode twice before the tests run, and reports whether both are the same bits."""

from __future__ import annotations

import math

import pytest

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.plugin.environment import variables_of_driving_known
from pytest_drive_robust.plugin.reporting import runs_tests
from pytest_drive_robust.plugin.run_outputs import RunOutputs
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.as_in_worker import as_in_worker
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.runner.scopes import Scopes, simulator_options
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.simulators.routes import resolve_routes


class ProbePlugin:
    """Probes when `--drive-probe` was given, in the controller of pytest-xdist or in the only process."""

    def __init__(self, config: pytest.Config, options: RunOptions, outputs: RunOutputs) -> None:
        self._config = config
        self._options = options
        self._outputs = outputs

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Drive the probe, print its sentence at once, and keep it for the reports. Drive nothing when no test runs."""
        if not runs_tests(self._config):
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
            simulator = registry.simulator(options.simulator, simulator_options(options))
            with variables_of_driving_known(self._config):
                found = drive_twice(scope.need(Setting.CLEAN, clean=False).perturbed[0], registry, simulator)
        except UsageError as error:  # a conftest.py that only the workers read may know the name
            return f"probe: not driven: {error}"
        return drives_compared(*found)


def drives_compared(first: EpisodeResult, second: EpisodeResult) -> str:
    """Return a sentence that compares two drives of one clean episode."""
    episode = first.episode
    twice = f"probe: {episode.agent} drove route {episode.route_id} clean twice with seed {episode.seed}"
    for broken in (first, second):
        if broken.outcome is Outcome.INFRA_ERROR:
            return f"{twice}, but the simulation broke, so nothing was learned: {broken.end_detail}"
    unlike = difference(second, first)
    if not unlike:
        return f"{twice}: the same {first.ticks} ticks bit for bit, so one seed suffices to repeat a run"
    places = zip(*(zip(*one.trace.columns("x_m", "y_m"), strict=True) for one in (first, second)), strict=False)
    apart_m = max((math.dist(one, other) for one, other in places), default=0.0)
    return (
        f"{twice}: not the same {unlike}, up to {apart_m:.2f} m apart, driving scores "
        f"{driving_score(first):.2f} and {driving_score(second):.2f}. "
        "One seed does not repeat a run: give several (--drive-seeds 0,1,2) and let evidence judge"
    )


def drive_twice(
    request: EpisodeRequest, registry: Registry, simulator: Simulator
) -> tuple[EpisodeResult, EpisodeResult]:
    """Drive an episode twice on one simulator, each time with a new agent object; close the simulator.

    Raises `UsageError` when the agent cannot be made.
    """
    drivers = [EpisodeDriver(lambda: simulator, lambda name: make_agent(registry, name)) for _ in range(2)]
    try:
        with as_in_worker():
            return drivers[0].drive_once(request), drivers[1].drive_once(request)
    finally:
        simulator.close()
