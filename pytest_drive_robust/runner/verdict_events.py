"""Makes the events of a requirement: its needed episodes, its verdict, the result of a search."""

from __future__ import annotations

from dataclasses import replace

from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.plan import RouteRequests, Scope, VerdictPlan, keys_of
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Searched, VerdictPlanned
from pytest_drive_robust.verdict.evaluate import Verdict
from pytest_drive_robust.verdict.largest_severity import Bracket
from pytest_drive_robust.verdict.requirement import Requirement


def episodes_needed(scope: Scope, setting: Setting, need: RouteRequests) -> tuple[EpisodesNeeded, ...]:
    """Return the events for the needed episodes: first the clean twins, if any, then the episodes under `setting`."""
    clean, own = keys_of(need.clean), keys_of(need.perturbed)
    twins = () if clean == own else clean
    baseline = (EpisodesNeeded(**scope.named, setting=str(setting.baseline), keys=twins),) if twins else ()
    return (*baseline, EpisodesNeeded(**scope.named, setting=str(setting), keys=own, clean_keys=twins))


def verdict_planned(plan: VerdictPlan) -> VerdictPlanned:
    """Return the event that says which episodes a verdict will read."""
    setting, ordered = plan.requirement.setting, RouteRequests.joined(plan.routes)
    return VerdictPlanned(
        **plan.scope.named,
        requirement=str(plan.requirement),
        setting=str(setting),
        rule=plan.rule,
        likely=plan.likely_routes,
        keys=keys_of(ordered.perturbed),
        clean=str(setting.baseline) if ordered.clean else "",
        clean_keys=keys_of(ordered.clean),
    )


def judged(verdict: Verdict, scope: Scope, nodeid: str) -> Judged:
    """Return the event of a verdict in the test `nodeid`."""
    why_open = verdict.reason if verdict.decision == "inconclusive" else ""
    return replace(
        not_judged(verdict.requirement, scope, nodeid, why_open),
        verdict=verdict.decision,
        value=float(verdict.value),
        low=float(verdict.low),
        high=float(verdict.high),
        routes=verdict.routes,
        planned=verdict.planned,
        rule=verdict.verdict_rule.kind,
        p_value=verdict.p_value,
        family=verdict.verdict_rule.family,
        margin=verdict.margin,
    )


def not_judged(requirement: Requirement, scope: Scope, nodeid: str, why: str) -> Judged:
    """Return the event of an error in place of a verdict; `why` is its message."""
    return Judged(
        **scope.named,
        nodeid=nodeid,
        requirement=str(requirement),
        metric=requirement.metric.name,
        setting=str(requirement.setting),
        comparison=requirement.comparison,
        limit=float(requirement.limit),
        verdict="error",
        message=why,
    )


def searched(bracket: Bracket, scope: Scope, nodeid: str) -> Searched:
    """Return the event of a search: the severities between which a requirement stops holding."""
    return Searched(
        **scope.named,
        nodeid=nodeid,
        sentence=str(bracket),
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
