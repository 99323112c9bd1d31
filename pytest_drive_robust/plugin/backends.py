"""Chooses what answers the episode requests of a run: our simulators, the official evaluator, or existing results."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pytest_drive_robust.engine.platform_check import check_platform
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.option import asked_for
from pytest_drive_robust.options.run import BENCH2DRIVE, DEFAULT_STORE, RESULTS, RunOptions
from pytest_drive_robust.plugin.environment import environment_of
from pytest_drive_robust.plugin.external_options import RESULTS_READ
from pytest_drive_robust.plugin.process_roles import is_worker
from pytest_drive_robust.registry.plugins import naming_plugins, plugin_source
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.lockstep.offered import factory_offers_lockstep
from pytest_drive_robust.runner.scopes import Scopes, simulator_options
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.base import EpisodeStore

if TYPE_CHECKING:  # few sessions drive in the official evaluator
    from pytest_drive_robust.bench2drive.evaluator.executor import Bench2DriveExecutor


def backend_for(
    config: pytest.Config,
    options: RunOptions,
    execution: ExecutionOptions,
    *,
    store: EpisodeStore,
    ticked: Callable[[], object],
) -> tuple[Scopes, Executor]:
    """Return the scopes of tests and the executor of their episodes. No process starts before the first episode.

    `ticked` is called after every tick that this process drives itself. Raises `UsageError` for options or a platform
    that the executor cannot use.
    """
    if options.is_external:
        return _external_backend(config, options, execution)
    scopes = Scopes(
        options,
        default_registry(),
        resolve_routes,
        lockstep=execution.lockstep is not None,
        is_stored=lambda key: store.get(key) is not None,
    )
    return scopes, _executor(config, options, execution, scopes=scopes, ticked=ticked)


def _external_backend(
    config: pytest.Config, options: RunOptions, execution: ExecutionOptions
) -> tuple[Scopes, Executor]:
    """Return the scopes and the executor of the official evaluator, or of results. Raises `UsageError`."""
    from pytest_drive_robust.bench2drive.results.external_scopes import ExternalScopes, ResultsScopes

    registry = default_registry()
    if options.simulator == RESULTS:
        results = config.stash[RESULTS_READ]
        return ResultsScopes(options, registry, resolve_routes, results), results
    evaluator = _evaluator(config, options, execution)
    return ExternalScopes(options, registry, resolve_routes, evaluator), evaluator


def _evaluator(config: pytest.Config, options: RunOptions, execution: ExecutionOptions) -> Bench2DriveExecutor:
    """Return the executor of the official evaluator. Raises `UsageError` when the evaluator cannot run here."""
    check_platform(
        f"--drive-sim {BENCH2DRIVE}", "Drive there, and judge the records here: --drive-results SETTING=FOLDER."
    )
    from pytest_drive_robust.bench2drive.evaluator.attempt import Patience
    from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
    from pytest_drive_robust.bench2drive.evaluator.executor import Bench2DriveExecutor

    patience = Patience()
    if asked_for("--drive-episode-timeout", config):  # its default is for our simulators, which are faster
        limit_s = execution.episode_timeout_s
        patience = replace(patience, route_s=math.inf if limit_s is None else limit_s)
    checkout = Checkout.find(Path(execution.b2d_root), python=execution.b2d_python)
    checkout.require_python("--drive-b2d-python")
    return Bench2DriveExecutor(
        checkout,
        folder=config.rootpath / (DEFAULT_STORE if options.store == "off" else options.store) / BENCH2DRIVE,
        routes=_route_file(options),
        slots=execution.workers or 1,
        fresh=options.fresh,
        hidden=True,
        patience=patience,
    )


def _executor(
    config: pytest.Config,
    options: RunOptions,
    execution: ExecutionOptions,
    *,
    scopes: Scopes,
    ticked: Callable[[], object],
) -> Executor:
    """Return the executor that the options name; `scopes` know the agents of the plan at the first episode."""
    if execution.executor == "inline":
        from pytest_drive_robust.runner.inline_executor import InlineExecutor

        return InlineExecutor(
            default_registry(),
            simulator=options.simulator,
            options=simulator_options(options),
            ticked=ticked,
            width=execution.lockstep,
            folder=config.invocation_params.dir,
            environment=lambda: environment_of(config),
        )
    check_platform(f"--drive-executor {execution.executor}")
    limits = Limits(
        episode_s=execution.episode_timeout_s, act_s=execution.act_timeout_s, memory_bytes=execution.memory_bytes
    )
    worker_setup = partial(_worker_setup, config, options, execution, scopes)
    if execution.executor == "ray":
        from pytest_drive_robust.engine.ray.executor import RayExecutor

        return RayExecutor(worker_setup, limits, address=execution.ray_address, slots=execution.workers)
    from pytest_drive_robust.engine.pool import ProcessExecutor

    return ProcessExecutor(
        worker_setup,
        limits,
        slots=execution.slots(shared=is_worker(config)),
        width=execution.lockstep,
        shares=lambda agent: factory_offers_lockstep(agent, default_registry()),
        check_loaded=scopes.require_unchanged_code if options.store != "off" else lambda: None,
    )


def _worker_setup(
    config: pytest.Config, options: RunOptions, execution: ExecutionOptions, scopes: Scopes
) -> WorkerSetup:
    """Return what a worker process needs to resolve the same names as this process."""
    own = {} if execution.executor == "ray" else environment_of(config)  # each node keeps its own environment
    return WorkerSetup(
        python_path=tuple(place for place in sys.path if isinstance(place, str)),  # Python passes over a `Path`
        folder=str(config.invocation_params.dir),  # a test may have changed the current folder
        plugins=tuple(plugin_source(plugin) for plugin in naming_plugins(config.pluginmanager)),
        simulator=options.simulator,
        options=simulator_options(options),
        preload_agents=scopes.agents,
        sources=scopes.sources() if options.store != "off" else (),
        environment=tuple(own.items()),
    )


def _route_file(options: RunOptions) -> Path | None:
    """Return the route file that the evaluator reads: the one of `--drive-routes`, else its own 220 routes."""
    if not options.routes_given:
        return None
    file = Path(options.routes if options.routes.endswith(".xml") else options.routes.rpartition(":")[0])
    return file if file.is_file() else None
