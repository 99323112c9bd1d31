"""What the record of a run is told of a requirement: what it asked for, its verdict, what a search found."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.store.events import Asked, Judged, Searched

if TYPE_CHECKING:
    from pytest_drive_robust.runner.plan import EpisodeRequest, Need, Scope
    from pytest_drive_robust.verdict.evaluate import Verdict
    from pytest_drive_robust.verdict.largest_severity import Bracket
    from pytest_drive_robust.verdict.requirement import Requirement

__all__ = ["asked", "judged", "not_judged", "searched"]


def asked(scope: Scope, need: Need) -> tuple[Asked, ...]:
    """Return what is asked for: the setting, and its clean twins as a setting of their own."""
    clean, own = _keys(need.clean), _keys(need.perturbed)
    twins = () if clean == own else clean
    perturbed = Asked(scope.agent, scope.routes_spec, str(need.setting), scope.seeds, own, twins)
    if not twins:
        return (perturbed,)
    return (Asked(scope.agent, scope.routes_spec, str(need.setting.baseline), scope.seeds, twins, ()), perturbed)


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
