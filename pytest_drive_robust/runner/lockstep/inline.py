"""Lockstep in this process."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.executors import InlineExecutor
from pytest_drive_robust.runner.lockstep.admission import factory_offers_lockstep
from pytest_drive_robust.runner.lockstep.executor import LockstepExecutor
from pytest_drive_robust.runner.lockstep.lockstep import Lockstep

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import SimulatorOptions

__all__ = ["lockstep_inline"]


def lockstep_inline(
    registry: Registry, *, simulator: str, options: SimulatorOptions, ticked: Callable[[], object], width: int
) -> LockstepExecutor:
    """Return the executor of lockstep in this process, where nothing protects the run from the agent.

    `ticked` is called after every tick of each episode.
    """
    driver = Lockstep(
        lambda: registry.simulator(simulator, options),
        lambda name: make_agent(registry, name),
        width=width,
        on_tick=lambda *_: ticked(),
    )
    return LockstepExecutor(
        InlineExecutor(registry, simulator=simulator, options=options, ticked=ticked),
        lambda: [driver],
        width=width,
        shares=lambda agent: factory_offers_lockstep(agent, registry),
    )
