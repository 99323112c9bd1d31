"""From a requirement to the episodes that it needs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.cache_key.canonical import digest_of
from pytest_drive_robust.runner.cache_key.code import perturbation_sources

if TYPE_CHECKING:
    from pytest_drive_robust.verdict.model import Requirement

__all__ = ["EpisodeRequest", "Need", "Scope"]


@dataclass(frozen=True)
class EpisodeRequest:
    """An episode together with what is needed to drive it.

    `identity` is a digest of everything else that decides the outcome: the agent, the simulator, our own code (see
    `identity.identity_of`). It is empty where nobody looks for an earlier drive of the same.
    """

    episode: Episode
    route: Route
    setting: Setting
    identity: str = ""

    @cached_property
    def key(self) -> str:
        """Hex name of the episode in every store: two with the same key end the same, to the bit.

        The content of the route counts because two route files may use the same id for different routes, and the
        source of perturbations that are not ours because the sentence of a setting says only what they are called.
        """
        return digest_of(self.identity, self.episode, _content_of(self.route), perturbation_sources(self.setting))


@dataclass(frozen=True)
class Scope:
    """What one test drives over: an agent, a set of routes (`routes_spec` is how it was called), seeds.

    `identity`: see `EpisodeRequest`.
    """

    agent: str
    routes_spec: str
    routes: tuple[Route, ...]
    seeds: tuple[int, ...]
    identity: str = ""

    def need(self, setting: Setting, *, clean: bool) -> Need:
        """The episodes under `setting` and, if `clean` is asked for, their clean twins.

        The twins are driven under `setting.baseline`, which has the warm-up of `setting`: a baseline that may drive
        off earlier would make the setting look worse than it is.
        """
        perturbed = self._requests(setting)
        if setting.is_clean:
            return Need(setting, perturbed if clean else (), perturbed)
        return Need(setting, self._requests(setting.baseline) if clean else (), perturbed)

    def plan(self, requirements: Iterable[Requirement]) -> dict[str, EpisodeRequest]:
        """Every episode that judging `requirements` takes, by key, each once, in the order of need."""
        return {
            request.key: request
            for requirement in requirements
            for request in self.need(requirement.setting, clean=requirement.needs_clean).requests
        }

    def _requests(self, setting: Setting) -> tuple[EpisodeRequest, ...]:
        """One request for each route and seed, seeds varying slowest so that a picture of all routes comes early."""
        sentence = str(setting)
        return tuple(
            EpisodeRequest(Episode(self.agent, route.id, sentence, seed), route, setting, self.identity)
            for seed in self.seeds
            for route in self.routes
        )


@dataclass(frozen=True, slots=True)
class Need:
    """The episodes under one setting with their clean twins (none when nobody compares)."""

    setting: Setting
    clean: tuple[EpisodeRequest, ...]
    perturbed: tuple[EpisodeRequest, ...]

    @property
    def requests(self) -> tuple[EpisodeRequest, ...]:
        """All of them, the clean ones first, each once."""
        return tuple({request.key: request for request in (*self.clean, *self.perturbed)}.values())


_CONTENTS: dict[int, tuple[Route, str]] = {}
"""Digests of routes by the place of the object: a plan asks for the same few routes thousands of times."""
_MOST_CONTENTS = 10_000


def _content_of(route: Route) -> str:
    known = _CONTENTS.get(id(route))
    if known is not None and known[0] is route:
        return known[1]
    if len(_CONTENTS) >= _MOST_CONTENTS:
        _CONTENTS.clear()
    digest = digest_of(route)
    _CONTENTS[id(route)] = route, digest
    return digest
