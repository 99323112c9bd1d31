"""What the record of a run is told of a requirement: what it asked for, its verdict, what a search found."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.store.events import Asked, Awaited, Judged, Read, Searched

if TYPE_CHECKING:
    from pytest_drive_robust.runner.plan import EpisodeRequest, Need, Reading, Scope
    from pytest_drive_robust.verdict.evaluate import Verdict
    from pytest_drive_robust.verdict.largest_severity import Bracket
    from pytest_drive_robust.verdict.requirement import Requirement

__all__ = ["asked", "awaited", "judged", "not_judged", "read", "searched"]


def asked(scope: Scope, need: Need) -> tuple[Asked, ...]:
    """Return what is asked for: the setting, and its clean twins as a setting of their own."""
    clean, own = _keys(need.clean), _keys(need.perturbed)
    twins = () if clean == own else clean
    perturbed = Asked(scope.agent, scope.routes_spec, str(need.setting), scope.seeds, own, twins)
    if not twins:
        return (perturbed,)
    return (Asked(scope.agent, scope.routes_spec, str(need.setting.baseline), scope.seeds, twins, ()), perturbed)


def awaited(reading: Reading) -> Awaited:
    """Return what a selected test will read."""
    scope, need = reading.scope, reading.need
    perturbed = tuple(request for route in reading.routes for request in route.perturbed)
    clean = tuple(request for route in reading.routes for request in route.clean)
    return Awaited(
        requirement=str(reading.requirement),
        agent=scope.agent,
        routes_spec=scope.routes_spec,
        seeds=scope.seeds,
        setting=str(need.setting),
        rule=reading.kind,
        likely=reading.likely_routes,
        keys=_keys(perturbed),
        route_ids=tuple(request.route.id for request in perturbed),
        clean=str(need.setting.baseline) if clean else "",
        clean_keys=_keys(clean),
    )


def read(reading: Reading, routes: int, likely: int) -> Read:
    """Return how far a verdict is."""
    scope = reading.scope
    return Read(str(reading.requirement), scope.agent, scope.routes_spec, scope.seeds, routes, likely)


def judged(verdict: Verdict, scope: Scope, nodeid: str) -> Judged:
    """Return the verdict of the test `nodeid`."""
    return replace(
        not_judged(verdict.requirement, scope, nodeid, verdict.reason),
        verdict=verdict.decision,
        value=float(verdict.value),
        low=float(verdict.low),
        high=float(verdict.high),
        routes=verdict.routes,
        planned=verdict.planned,
        rule=verdict.verdict_rule.kind,
        p_value=verdict.p_value,
        family=verdict.verdict_rule.family,
    )


def not_judged(requirement: Requirement, scope: Scope, nodeid: str, why: str) -> Judged:
    """Return the error that takes the place of a verdict."""
    return Judged(
        nodeid=nodeid,
        requirement=str(requirement),
        agent=scope.agent,
        routes_spec=scope.routes_spec,
        seeds=scope.seeds,
        metric=requirement.metric.name,
        setting=str(requirement.setting),
        comparison=requirement.comparison,
        limit=float(requirement.limit),
        verdict="error",
        message=why,
    )


def searched(bracket: Bracket, scope: Scope, nodeid: str) -> Searched:
    """Return the severities between which a requirement stops to hold."""
    return Searched(
        nodeid=nodeid,
        sentence=str(bracket),
        agent=scope.agent,
        routes_spec=scope.routes_spec,
        seeds=scope.seeds,
        failure=bracket.ladder.word,
        unit=bracket.ladder.unit,
        metric=bracket.metric.name,
        comparison=bracket.comparison,
        limit=bracket.limit,
        rule=bracket.rule,
        holds=bracket.holds,
        breaks=bracket.breaks,
        undecided=bracket.undecided,
    )


def _keys(requests: tuple[EpisodeRequest, ...]) -> tuple[str, ...]:
    return tuple(request.key for request in requests)
