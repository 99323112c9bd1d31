"""Drive held-out routes to choose weights, by the package's own campaign, worker processes and store."""

from __future__ import annotations

import math
import os
import sys
import uuid
from collections.abc import Sequence
from math import fsum
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from drive_robust_agents.training import candidates
from pytest_drive_robust import Setting
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.pool import ProcessExecutor
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.metrics.episodes import require_scorable
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import DEFAULT_SIMULATOR, RunOptions
from pytest_drive_robust.registry.plugins import plugin_source
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.scheduler import Scheduler
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.stats.intervals import mean_interval, ratio_interval, share_interval
from pytest_drive_robust.store.events import Event, Finished, Reused
from pytest_drive_robust.store.folder import FolderStore

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["degradation", "drive", "summary"]

_STUCK_STOP_S = 45.0
"""Seconds of standing that end an episode; longer than the 40 s after which `simlingo` creeps, as published."""

Driven = dict[tuple[str, str], list["EpisodeResult"]]
"""Results by (agent, setting), in the order of the routes."""


def drive(
    agents: Sequence[str],
    settings: Sequence[str],
    routes: Sequence[Route],
    *,
    workers: int,
    store: Path,
    simulator: str = DEFAULT_SIMULATOR,
    plugin: ModuleType = candidates,
) -> Driven:
    """Drive every agent (a registered name) under every setting on all routes, with one seed; return the results.

    `plugin` registers additional names. Episodes in the store are not driven again. Raises `AgentError` for an agent
    that fails, because a failed agent has no score.
    """
    registry = default_registry()
    plugin.pytest_drive_robust_register(registry)
    options = SimulatorOptions(stuck_stop_s=_STUCK_STOP_S)
    chosen = RunOptions(routes="held-out", routes_given=True, simulator=simulator, stuck_stop_s=_STUCK_STOP_S)
    scopes = Scopes(chosen, registry, lambda spec: tuple(routes))
    plan: dict[tuple[str, str], Sequence[EpisodeRequest]] = {
        (agent, setting): scopes.of(MarkerOptions(agent=agent)).need(Setting.parse(setting), clean=False).perturbed
        for agent in agents
        for setting in settings
    }
    requests = [request for part in plan.values() for request in part]
    held = FolderStore(store, run=uuid.uuid4().hex)
    worker_setup = WorkerSetup(
        python_path=tuple(sys.path),
        folder=os.getcwd(),
        plugins=(plugin_source(plugin),),
        simulator=chosen.simulator,
        options=options,
    )
    with _ProgressBar(len(requests)) as watch:
        scheduler = Scheduler(held, ProcessExecutor(lambda: worker_setup, Limits(), slots=workers), watch)
        try:
            scheduler.ensure(requests)
        finally:
            scheduler.close()
    return {key: [_scorable(held.get(request.key)) for request in part] for key, part in plan.items()}


def summary(results: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Return driving score (0 to 100) and success rate (0 to 1) with 95 % intervals, also by scenario type."""
    scores, successes = [driving_score(one) for one in results], [float(is_success(one)) for one in results]
    types: dict[str, list[EpisodeResult]] = {}
    for one in results:
        types.setdefault(one.scenario, []).append(one)
    return {
        "episodes": len(results),
        "driving_score": _mean(scores),
        "driving_score_interval": mean_interval(scores, bounds=(0.0, 100.0)),
        "success_rate": _mean(successes),
        "success_rate_interval": share_interval(successes),
        "by_type": {
            name: {
                "successes": sum(map(is_success, group)),
                "episodes": len(group),
                "driving_score": _mean([driving_score(one) for one in group]),
            }
            for name, group in sorted(types.items())
        },
    }


def degradation(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Return RD = 1 - DS / clean DS, paired by route, with Fieller's 95 % interval.

    Values are None when the clean driving score is 0; so is a bound that the episodes do not determine.
    """
    before, after = [driving_score(one) for one in clean], [driving_score(one) for one in perturbed]
    if not any(before):
        return {"rd": None, "rd_interval": None}
    interval = ratio_interval(before, after)
    known = [bound if math.isfinite(bound) else None for bound in interval]
    return {"rd": 1.0 - fsum(after) / fsum(before), "rd_interval": known}


class _ProgressBar:
    """A progress bar that listens to the scheduler (see `runner.scheduler.Observer`)."""

    def __init__(self, total: int) -> None:
        columns = (TextColumn("drive"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._progress = Progress(*columns)
        self._bar = self._progress.add_task("", total=total)

    def __enter__(self) -> _ProgressBar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def __call__(self, event: Event) -> None:
        """Count a finished episode."""
        if isinstance(event, (Finished, Reused)):
            self._progress.advance(self._bar)

    def ticked(self) -> None:
        """Do nothing: the bar redraws itself."""

    def idle(self) -> None:
        """Do nothing: the bar stays."""


def _scorable(result: EpisodeResult | None) -> EpisodeResult:
    assert result is not None  # the scheduler has driven this episode
    if result.outcome is Outcome.AGENT_ERROR:
        raise AgentError(f"{result.episode}: {result.end_detail}")
    require_scorable([result])
    return result


def _mean(values: Sequence[float]) -> float:
    return fsum(values) / len(values)
