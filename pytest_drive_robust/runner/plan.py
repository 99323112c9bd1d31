"""Plans a requirement: which episodes its verdict needs, and in which order its routes are read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.cache_key.canonical_text import digest_of
from pytest_drive_robust.runner.cache_key.code_text import perturbation_sources
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.stats.judges import Judge, judge_by
from pytest_drive_robust.stats.pace import likely_left
from pytest_drive_robust.verdict.requirement import Requirement

_FIRST = 3
"""Episodes of an agent from which its driving time is estimated: their lengths differ by a factor of three."""


@dataclass(frozen=True)
class EpisodeRequest:
    """An episode with everything that is needed to drive it.

    `identity` is the digest of `identity.identity_of`, or `""` when no stored episode is looked for.
    """

    episode: Episode
    route: Route
    setting: Setting
    identity: str = ""

    @cached_property
    def key(self) -> str:
        """The name of the episode in every store, as hex digits: two episodes with one key end the same, to the bit.

        The key covers the content of the route, because two route files may use one id for different routes, and the
        source of perturbations that are not ours, because the sentence of a setting holds only their names.
        """
        return digest_of(self.identity, self.episode, _content_of(self.route), perturbation_sources(self.setting))


@dataclass(frozen=True)
class Scope:
    """The agent, the routes and the seeds of one test. `routes_spec` is the name of the set of routes."""

    agent: str
    routes_spec: str
    routes: tuple[Route, ...]
    seeds: tuple[int, ...]
    identity: str = ""

    def need(self, setting: Setting, *, clean: bool) -> RouteRequests:
        """Return the episodes of all routes under `setting` and, with `clean`, their clean twins.

        The twins are driven under `setting.baseline`, which has the warm-up of `setting`: a baseline that may drive
        off earlier would make the setting look worse than it is.
        """
        return RouteRequests(self._requests(setting.baseline) if clean else (), self._requests(setting))

    def plan(self, requirements: Iterable[Requirement]) -> dict[str, EpisodeRequest]:
        """Return every episode that judging `requirements` may need, by key, in the order of need."""
        return {
            request.key: request
            for requirement in requirements
            for request in self.need(requirement.setting, clean=requirement.needs_clean).requests
        }

    def verdict_plan(self, requirement: Requirement, verdict_rule: VerdictRule | None) -> VerdictPlan:
        """Return the plan of a verdict on `requirement` by `verdict_rule`; None compares the value over all routes."""
        need = self.need(requirement.setting, clean=requirement.needs_clean)
        verdict_rule = (verdict_rule or VerdictRule("point")).for_routes(len(self.routes))
        rule = verdict_rule.kind if requirement.reads_routes(verdict_rule) else "point"
        return VerdictPlan(requirement, self, need, routes_in_order(self, need), rule, verdict_rule)

    @property
    def named(self) -> dict[str, Any]:
        """The fields by which events name the scope."""
        return {"agent": self.agent, "routes_spec": self.routes_spec, "seeds": self.seeds}

    def _requests(self, setting: Setting) -> tuple[EpisodeRequest, ...]:
        """Return one request for each route and seed, all routes of one seed first: all routes are seen early."""
        sentence = str(setting)
        return tuple(
            EpisodeRequest(Episode(self.agent, route.id, sentence, seed), route, setting, self.identity)
            for seed in self.seeds
            for route in self.routes
        )


@dataclass(frozen=True, slots=True)
class RouteRequests:
    """The episodes of one or more routes under one setting, and their clean twins (empty when nothing is compared)."""

    clean: tuple[EpisodeRequest, ...]
    perturbed: tuple[EpisodeRequest, ...]

    @classmethod
    def joined(cls, routes: Sequence[RouteRequests]) -> RouteRequests:
        """Return the requests of several routes as one."""
        clean, perturbed = (route.clean for route in routes), (route.perturbed for route in routes)
        return cls(tuple(chain.from_iterable(clean)), tuple(chain.from_iterable(perturbed)))

    @property
    def requests(self) -> tuple[EpisodeRequest, ...]:
        """All requests, each once, the clean ones first."""
        return tuple({request.key: request for request in (*self.clean, *self.perturbed)}.values())


@dataclass(frozen=True, slots=True)
class VerdictPlan:
    """The episodes that a verdict on `requirement` reads: `need`, in the order of `routes`, by the judge of `rule`."""

    requirement: Requirement
    scope: Scope
    need: RouteRequests
    routes: tuple[RouteRequests, ...]
    rule: str
    verdict_rule: VerdictRule

    def judge(self) -> Judge:
        """Return a new judge of this plan."""
        given = self.verdict_rule
        forms = self.requirement.linear_forms(given)
        floor = given.clean_floor if self.requirement.needs_clean else 0.0
        planned = len(self.routes)
        return judge_by(self.rule, forms, planned=planned, alpha=given.alpha, fail_alpha=given.fail_alpha, floor=floor)

    @property
    def likely_routes(self) -> int:
        """The number of routes that the verdict probably reads, estimated before any route is read."""
        if self.rule == "point":
            return len(self.routes)
        return likely_left(self.judge(), len(self.routes))

    def requests(self, first: int, last: int | None = None) -> tuple[EpisodeRequest, ...]:
        """Return the requests of the routes from place `first` up to, not including, `last`, in reading order."""
        return tuple(request for route in self.routes[first:last] for request in route.requests)

    @property
    def likely(self) -> tuple[EpisodeRequest, ...]:
        """The requests that the verdict probably reads."""
        return self.requests(0, self.likely_routes)


def keys_of(requests: Iterable[EpisodeRequest]) -> tuple[str, ...]:
    """Return the keys of `requests`, in their order."""
    return tuple(request.key for request in requests)


def first_of_each_agent(verdict_plans: Iterable[VerdictPlan]) -> tuple[EpisodeRequest, ...]:
    """Return the first episodes of every agent except the first agent, which is driven at once anyway."""
    verdict_plans = tuple(verdict_plans)
    agents = {plan.scope.agent: plan for plan in reversed(verdict_plans)}
    own = verdict_plans[0].scope.agent if verdict_plans else ""
    return tuple(request for agent, plan in agents.items() if agent != own for request in plan.likely[:_FIRST])


def routes_in_order(scope: Scope, need: RouteRequests) -> tuple[RouteRequests, ...]:
    """Return the routes of `need` in planned order. All requirements of a scope share one order.

    The name and place of the route file do not matter: `r.xml`, `./r.xml` and the absolute path give the same order. An
    added route leaves most other routes in their places, so that their stored episodes are still used.
    """
    ids = [route.id for route in scope.routes]
    types = [route.scenario.type for route in scope.routes]
    order = planned_order(ids, types, scope.agent)
    of_route = {route: slice(place, None, len(ids)) for place, route in enumerate(ids)}  # seed after seed
    return tuple(RouteRequests(need.clean[of_route[route]], need.perturbed[of_route[route]]) for route in order)


_CONTENTS: dict[int, tuple[Route, str]] = {}
"""Digests of routes by `id()` of the object: a plan needs the same few routes thousands of times."""


def _content_of(route: Route) -> str:
    if id(route) not in _CONTENTS:
        _CONTENTS[id(route)] = route, digest_of(route)  # keeping the object keeps its id unique
    return _CONTENTS[id(route)][1]
