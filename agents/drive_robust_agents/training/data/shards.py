"""One shard: a few routes, driven and written by one process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drive_robust_agents.training.data.dagger import Mixture, agent_of, drive_mixture
from drive_robust_agents.training.data.expert_episode import SHIPPED, Teacher
from drive_robust_agents.training.data.frames import write_shard
from drive_robust_agents.training.data.labels import Row
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.data.rollouts import Sample, drive_expert
from drive_robust_agents.training.data.routes import RouteKey, draw
from drive_robust_agents.training.data.rows import rows
from pytest_drive_robust.domain.route import Route

__all__ = ["Shard", "WrittenShard", "write"]


@dataclass(frozen=True, slots=True)
class Shard:
    """The definition of a shard: `keys` are its routes, `first` is the number of its first route among all routes."""

    folder: Path
    number: int
    keys: tuple[RouteKey, ...]
    first: int
    agent: str
    episodes: int
    data_seed: int
    mixture: Mixture | None = None
    teacher: Teacher = SHIPPED


@dataclass(frozen=True, slots=True)
class WrittenShard:
    """The result of writing a shard."""

    number: int
    rows: int
    size_bytes: int


def write(shard: Shard) -> WrittenShard:
    """Drive and write a shard."""
    drive = _driver(shard)
    found: list[Row] = []
    skipped = []
    for k, key in enumerate(shard.keys):
        route = draw(key)
        if route is None:
            skipped.append(key.id)
            continue
        for number in range(shard.episodes):
            samples = drive(route, number)
            episode = (shard.first + k) * shard.episodes + number
            found += rows(samples, route, agent_rig(shard.agent), tag=key.tag, episode=episode)
    about: dict[str, Any] = {"routes": [key.id for key in shard.keys], "seed": shard.data_seed, "skipped": skipped}
    return WrittenShard(shard.number, len(found), write_shard(shard.folder, shard.number, found, about))


def _driver(shard: Shard) -> Callable[[Route, int], list[Sample]]:
    """Return the function (route, seed) that drives an episode and returns its samples."""
    data_seed, teacher, mixture = shard.data_seed, shard.teacher, shard.mixture
    if mixture is None:
        return lambda route, seed: drive_expert(route, data_seed=data_seed, seed=seed, teacher=teacher)
    agent = agent_of(mixture)
    return lambda route, seed: drive_mixture(
        route, agent=agent, mixture=mixture, data_seed=data_seed, seed=seed, teacher=teacher
    )
