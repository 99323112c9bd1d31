"""From a requirement to the episodes that it needs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.setting import Setting

if TYPE_CHECKING:
    from pytest_drive_robust.requirements.model import Requirement

__all__ = ["Need", "Scope", "Task"]


@dataclass(frozen=True)
class Task:
    """An episode together with what is needed to drive it."""

    episode: Episode
    route: Route
    setting: Setting

    @cached_property
    def key(self) -> str:
        """Hex name of the episode within a run: its four words and the content of its route.

        The content counts because two route files may use the same id for different routes.
        """
        text = repr((self.episode, self.route))
        return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


@dataclass(frozen=True)
class Scope:
    """What one test drives over: an agent, a set of routes (`routes_spec` is how it was called), seeds."""

    agent: str
    routes_spec: str
    routes: tuple[Route, ...]
    seeds: tuple[int, ...]

    def need(self, setting: Setting, *, clean: bool) -> Need:
        """The episodes under `setting` and, if `clean` is asked for, their clean twins.

        The twins are driven under `setting.baseline`, which has the warm-up of `setting`: a baseline that may drive
        off earlier would make the setting look worse than it is.
        """
        perturbed = self._tasks(setting)
        if setting.is_clean:
            return Need(setting, perturbed if clean else (), perturbed)
        return Need(setting, self._tasks(setting.baseline) if clean else (), perturbed)

    def plan(self, requirements: Iterable[Requirement]) -> dict[str, Task]:
        """Every episode that judging `requirements` takes, by key, each once, in the order of need."""
        return {
            task.key: task
            for requirement in requirements
            for task in self.need(requirement.setting, clean=requirement.needs_clean).tasks
        }

    def _tasks(self, setting: Setting) -> tuple[Task, ...]:
        """One task for each route and seed, seeds varying slowest so that a picture of all routes comes early."""
        sentence = str(setting)
        return tuple(
            Task(Episode(self.agent, route.id, sentence, seed), route, setting)
            for seed in self.seeds
            for route in self.routes
        )


@dataclass(frozen=True, slots=True)
class Need:
    """The episodes under one setting with their clean twins (none when nobody compares)."""

    setting: Setting
    clean: tuple[Task, ...]
    perturbed: tuple[Task, ...]

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All of them, the clean ones first, each once."""
        return tuple({task.key: task for task in (*self.clean, *self.perturbed)}.values())
