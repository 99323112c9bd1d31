"""Who answers the questions of a run: one of our worlds, the official evaluator, or results that are there already."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.options.execution import ExecutionOptions
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.runner.executors import Executor
    from pytest_drive_robust.runner.scopes import Scopes
    from pytest_drive_robust.store.base import EpisodeStore

__all__ = ["BENCH2DRIVE", "RESULTS", "crew_of", "is_outside", "outside_settings"]

RESULTS = "results"
"""What stands for a simulator, and for an agent without a name, with `--drive-results`."""
BENCH2DRIVE = "bench2drive"
"""The simulator that is the official evaluator."""


def is_outside(settings: RunOptions) -> bool:
    """True when no world of ours is driven."""
    return settings.simulator in (RESULTS, BENCH2DRIVE)


def outside_settings(config: pytest.Config, settings: RunOptions, execution: ExecutionOptions) -> RunOptions:
    """The settings of the run, where somebody else drives or has driven: there is nothing for our store to keep.

    The evaluator keeps its own records. Raises `UsageError` for options that do not go together.
    """
    if execution.results:
        if settings.simulator == BENCH2DRIVE:
            raise UsageError("--drive-results judges what was driven before: leave --drive-sim bench2drive out.")
        agent = config.getoption("drive_agent") or config.getini("drive_agent") or RESULTS
        return replace(settings, agent=agent, simulator=RESULTS, store="off")
    if settings.simulator != BENCH2DRIVE:
        return settings
    if not execution.b2d_root:
        raise UsageError(
            "--drive-sim bench2drive needs --drive-b2d-root=FOLDER, a checkout of Bench2Drive; "
            "`drive-robust doctor --root FOLDER` says what else is missing."
        )
    if config.getoption("dist", "no") != "no":
        raise UsageError(
            "--drive-sim bench2drive drives from one process: leave -n out; --drive-workers N gives N CARLA servers."
        )
    return replace(settings, store="off")


def crew_of(
    config: pytest.Config,
    settings: RunOptions,
    execution: ExecutionOptions,
    *,
    shared: bool,
    store: EpisodeStore,
    ticked: Callable[[], object],
) -> tuple[Scopes, Executor]:
    """What tests drive over and who drives it. Nothing is started. Raises `UsageError`.

    `shared`, `ticked`: see `executing.executor_of`.
    """
    from pytest_drive_robust.registry.registry import default_registry
    from pytest_drive_robust.runner.routes import resolve_routes
    from pytest_drive_robust.runner.scopes import Scopes

    registry = default_registry()
    if is_outside(settings):
        from pytest_drive_robust.bench2drive.results.outside import OutsideScopes

        if settings.simulator == RESULTS:
            from pytest_drive_robust.bench2drive.results.supply import ResultsExecutor

            results = ResultsExecutor.read(execution.results, registry.perturbations())
            return OutsideScopes(settings, registry, resolve_routes, results), results
        from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
        from pytest_drive_robust.bench2drive.evaluator.executor import Bench2DriveExecutor

        evaluator = Bench2DriveExecutor(
            Checkout.find(Path(execution.b2d_root)),
            folder=config.rootpath / ".drive-robust" / BENCH2DRIVE,
            routes=_route_file(settings),
            slots=execution.workers or 1,
        )
        return OutsideScopes(settings, registry, resolve_routes, evaluator), evaluator
    from pytest_drive_robust.plugin.executor import executor_of

    scopes = Scopes(
        settings,
        registry,
        resolve_routes,
        lockstep=execution.lockstep is not None,
        is_stored=lambda key: store.get(key) is not None,
    )
    return scopes, executor_of(config, settings, execution, shared=shared, agents=lambda: scopes.agents, ticked=ticked)


def _route_file(settings: RunOptions) -> Path | None:
    """The route file that the evaluator reads: the one of `--drive-routes`, else its own 220 routes."""
    if not settings.routes_given:
        return None
    file = Path(settings.routes if settings.routes.endswith(".xml") else settings.routes.rpartition(":")[0])
    return file if file.is_file() else None
