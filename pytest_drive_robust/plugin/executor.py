"""From the choices of a run to the executor that drives its episodes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.registry.plugins import naming_plugins, plugin_source
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.executors import InlineExecutor, factory_offers_lockstep
from pytest_drive_robust.simulators.base import SimulatorOptions

if TYPE_CHECKING:
    from pytest_drive_robust.options.execution import ExecutionOptions
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.runner.executors import Executor


def executor_of(
    config: pytest.Config,
    options: RunOptions,
    execution: ExecutionOptions,
    *,
    shared: bool,
    agents: Callable[[], tuple[str, ...]],
    ticked: Callable[[], object],
) -> Executor:
    """Return the executor that was asked for; nothing is started before its first episode.

    `shared`: other processes of this run drive beside us. `agents()` are the agents of the plan, asked for at the first
    episode. `ticked` is called after every tick that this process drives itself. Raises `UsageError` when the executor
    is not installed.
    """
    if execution.executor == "inline":
        world = SimulatorOptions(stuck_stop_s=options.stuck_stop_s)
        return InlineExecutor(
            default_registry(), simulator=options.simulator, options=world, ticked=ticked, width=execution.lockstep
        )
    limits = Limits(
        episode_s=execution.episode_timeout_s, act_s=execution.act_timeout_s, memory_bytes=execution.memory_bytes
    )

    def worker_setup() -> WorkerSetup:
        return _setup_of(config, options, agents())

    if execution.executor == "ray":
        from pytest_drive_robust.engine.ray.executor import RayExecutor

        return RayExecutor(worker_setup, limits, address=execution.ray_address, slots=execution.workers)
    from pytest_drive_robust.engine.pool import ProcessExecutor

    return ProcessExecutor(
        worker_setup,
        limits,
        slots=execution.slots(shared=shared),
        width=execution.lockstep,
        shares=lambda agent: factory_offers_lockstep(agent, default_registry()),
    )


def _setup_of(config: pytest.Config, options: RunOptions, agents: tuple[str, ...]) -> WorkerSetup:
    """Return how a fresh process comes to know the names that this one knows."""
    return WorkerSetup(
        python_path=tuple(sys.path),
        folder=os.getcwd(),
        plugins=tuple(plugin_source(plugin) for plugin in naming_plugins(config.pluginmanager)),
        simulator=options.simulator,
        options=SimulatorOptions(stuck_stop_s=options.stuck_stop_s),
        preload_agents=agents,
    )
