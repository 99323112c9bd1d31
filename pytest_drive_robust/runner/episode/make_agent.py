"""Making an agent: the one place where an agent is built that drives episodes of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.runner.episode.generators import borrowed_generators

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["make_agent"]


def make_agent(registry: Registry, name: str) -> Agent:
    """Build the agent of that name; the same object every time, whatever its constructor draws.

    The global generators are seeded by the agent's name alone while the constructor runs, and put back afterwards. By
    its name and not by the episode: one object is kept for many episodes, and which of them comes first depends on the
    order, the number of processes and what is stored already. An object that is made anew after an error must be the
    one that it replaces, too. What is drawn after the constructor is seeded by the episode (`generators.seed_for`).

    Raises `UsageError` when there is no such agent or it cannot be made.
    """
    with borrowed_generators(f"making {name}"):
        return registry.agent(name)
