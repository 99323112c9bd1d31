"""Reads a requirement route by route, in an order that was fixed before, until its verdict is in."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import fsum
from typing import TYPE_CHECKING, cast

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.verdict.forms import rule_of
from pytest_drive_robust.verdict.known import known_metric

if TYPE_CHECKING:
    from pytest_drive_robust.runner.plan import EpisodeRequest, Need, Scope
    from pytest_drive_robust.stats.judges import VerdictKind
    from pytest_drive_robust.verdict.model import Requirement

__all__ = ["Drive", "RouteRequests", "read_until_decided", "routes_in_order"]

Results = tuple[EpisodeResult, ...]
Drive = Callable[["tuple[EpisodeRequest, ...]"], Results]


@dataclass(frozen=True, slots=True)
class RouteRequests:
    """One route's episodes, clean and perturbed, over all seeds."""

    clean: tuple[EpisodeRequest, ...]
    perturbed: tuple[EpisodeRequest, ...]

    @property
    def requests(self) -> tuple[EpisodeRequest, ...]:
        """All of them, the clean ones first, each once."""
        return tuple({request.key: request for request in (*self.clean, *self.perturbed)}.values())


def routes_in_order(scope: Scope, need: Need) -> tuple[RouteRequests, ...]:
    """The routes of a need in planned order: the same for all requirements of a scope, so they share clean episodes."""
    from pytest_drive_robust.stats.order import planned_order

    ids = [route.id for route in scope.routes]
    types = [route.scenario.type for route in scope.routes]
    order = planned_order(ids, types, f"{scope.agent} on {scope.routes_spec}")
    clean, perturbed = _by_route(need.clean), _by_route(need.perturbed)
    return tuple(RouteRequests(clean.get(route, ()), perturbed[route]) for route in order)


def read_until_decided(
    requirement: Requirement, verdict_rule: VerdictRule, routes: Sequence[RouteRequests], drive: Drive, *, mode: str
) -> tuple[str, int]:
    """(decision, how many routes were read). Drives no route after the one that decided.

    A route whose episodes hold no data for the metric is driven but not read.
    """
    from pytest_drive_robust.stats.judges import judge_by

    rule = rule_of(requirement, verdict_rule)
    kind, alpha = cast("VerdictKind", verdict_rule.kind), verdict_rule.alpha
    judge = judge_by(kind, rule, planned=len(routes), alpha=alpha, fail_alpha=verdict_rule.fail_alpha)
    read: list[tuple[float, float]] = []
    for done, route in enumerate(routes, 1):
        drive(route.requests)
        scores = _scores(requirement, drive(route.clean), drive(route.perturbed), mode)
        if scores is not None:
            read.append(scores)
            if judge.read(*scores) is not None:
                return judge.close(), done
    if verdict_rule.kind == "list" and read:  # the list that can be read is shorter than planned
        judge = judge_by("point", rule, planned=len(read))
        for scores in read:
            judge.read(*scores)
    return judge.close(), len(routes)


def _scores(requirement: Requirement, clean: Results, perturbed: Results, mode: str) -> tuple[float, float] | None:
    """(score, reference) of one route, each the mean over its seeds."""
    metric = known_metric(requirement.metric)
    if metric.needs_clean:
        return _mean(map(driving_score, perturbed)), _mean(map(driving_score, clean))
    of_episode = metric.of_episode
    assert of_episode is not None  # a function over all episodes is never read route by route
    values = [value for result in perturbed if (value := of_episode(result, mode)) is not None]
    return (_mean(iter(values)), 0.0) if values else None


def _mean(values: Iterator[float]) -> float:
    found = list(values)
    return fsum(found) / len(found) if found else math.nan


def _by_route(requests: Sequence[EpisodeRequest]) -> dict[str, tuple[EpisodeRequest, ...]]:
    found: dict[str, list[EpisodeRequest]] = {}
    for request in requests:
        found.setdefault(request.route.id, []).append(request)
    return {route: tuple(own) for route, own in found.items()}
