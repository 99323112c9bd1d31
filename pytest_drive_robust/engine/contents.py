"""What decides the numbers of an episode and may differ between machines: a node with other code must not drive."""

from __future__ import annotations

import platform
from collections.abc import Callable
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.cache_key.identity import agent_identity, simulator_identity, weights_digest

if TYPE_CHECKING:
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["Contents", "check_contents", "contents_of"]

Contents = tuple[tuple[str, str], ...]
"""Digests, by what people call the thing."""


def contents_of(registry: Registry, agent: str, *, worker_setup: WorkerSetup, world: Simulator) -> Contents:
    """Return what drives here. Together they are what `identity_of` makes the keys of the store of.

    `world` is that of the setup. Raises `UsageError` when the agent does not load or weights do not read.
    """
    factory = registry.entry("agents", agent).load()
    return (
        ("weights", weights_digest(getattr(factory, "weights", ()), agent=agent)),
        ("code or configuration", agent_identity(agent, registry)),
        ("simulator or libraries", simulator_identity(worker_setup.simulator, registry, world, worker_setup.options)),
    )


def check_contents(
    registry: Registry, agent: str, *, worker_setup: WorkerSetup, world: Callable[[], Simulator]
) -> None:
    """Raise `UsageError` where another version of the agent, or of this package, would drive than was announced."""
    announced = dict(worker_setup.contents).get(agent)
    if announced is None:
        return
    found = dict(contents_of(registry, agent, worker_setup=worker_setup, world=world()))
    for what, digest in announced:
        if found[what] != digest:
            raise UsageError(
                f"the node {platform.node()} would drive with another {what} for {agent!r}: {digest or 'nothing'} was "
                f"announced, found {found[what] or 'nothing'}. Install the same versions on every node, and keep "
                "weights in the folder of the run or under the same path everywhere."
            )
