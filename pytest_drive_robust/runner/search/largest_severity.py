"""Searches the largest severity at which a requirement holds, on the episodes of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.store.events import Searched
from pytest_drive_robust.verdict.bracket import Answer, Bracket, Probe, SearchRule, bisect, contradictions
from pytest_drive_robust.verdict.known import known_metric
from pytest_drive_robust.verdict.model import Requirement

if TYPE_CHECKING:
    from pytest_drive_robust.perturbations.ladder import Ladder
    from pytest_drive_robust.runner.campaign import Campaign
    from pytest_drive_robust.runner.plan import Scope
    from pytest_drive_robust.verdict.evaluate import Verdict

__all__ = ["ALPHA", "largest", "searched"]

ALPHA = 0.1
"""Per severity and side. A bisection asks some five severities, and only those at the crossing are in doubt."""

_NO_MARGIN = 1e-9
"""None at all: the crossing itself is searched. A rule needs a number above 0."""

_FEWEST_FOR_EVIDENCE = 20
_ANSWERS: dict[str, Answer] = {"pass": "holds", "fail": "breaks"}


def largest(
    ladder: Ladder, campaign: Campaign, *, scope: Scope, metric: str, limit: float, comparison: str | None = None
) -> Bracket:
    """The bracket within which `metric comparison limit` stops to hold as the severity grows.

    With 20 routes or more, each severity is judged from evidence with margin 0, which stops as soon as it is decided;
    a severity that stays undecided sends the search to the side on which its value lies. With fewer, the value over all
    routes is compared with the limit. The severities that are tried depend on the answers alone, not on what else the
    run has driven; episodes that it has are not driven again.

    `comparison` is `"<="` for metrics of which less is better, else `">="`. Raises `RequirementError` for a metric or a
    limit that no requirement can have, and `ComparisonError` where a severity cannot be judged.
    """
    known = known_metric(metric)
    compares = comparison or (">=" if known.higher_is_better else "<=")
    rule: SearchRule = "evidence" if _reads_evidence(scope, metric) else "point"
    verdict_rule = VerdictRule(rule, margin=_NO_MARGIN, alpha=ALPHA)

    def requirement(level: float) -> Requirement:
        return Requirement(metric, Setting.of(ladder.at(level)), compares, limit)

    def ask(level: float) -> Probe:
        return _probe(level, campaign.decide(requirement(level), scope, verdict_rule).verdict)

    probes = bisect(ladder, ask)
    warnings = contradictions(ladder, known, probes)
    return Bracket(ladder, metric, compares, requirement(ladder.levels[0]).limit, rule, ALPHA, probes, warnings)


def searched(bracket: Bracket, scope: Scope, nodeid: str) -> Searched:
    """The bracket for the record of the run."""
    return Searched(
        nodeid=nodeid,
        sentence=str(bracket),
        agent=scope.agent,
        routes_spec=scope.routes_spec,
        seeds=scope.seeds,
        failure=bracket.ladder.word,
        unit=bracket.ladder.unit,
        metric=bracket.metric,
        comparison=bracket.comparison,
        limit=bracket.limit,
        rule=bracket.rule,
        holds=bracket.holds,
        breaks=bracket.breaks,
        undecided=bracket.undecided,
    )


def _probe(level: float, verdict: Verdict) -> Probe:
    answer = _ANSWERS.get(verdict.decision, "undecided")
    meets = verdict.requirement.is_met_by(verdict.value)
    return Probe(level, answer, verdict.value, meets, verdict.routes)


def _reads_evidence(scope: Scope, metric: str) -> bool:
    return len(scope.routes) >= _FEWEST_FOR_EVIDENCE and known_metric(metric).function is None
