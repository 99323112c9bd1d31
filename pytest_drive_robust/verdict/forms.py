"""A requirement under a verdict_rule, as the linear forms of one route's scores that `stats` reads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.verdict.known import known_metric

if TYPE_CHECKING:
    from pytest_drive_robust.stats.planning import Advice
    from pytest_drive_robust.stats.rules import Rule
    from pytest_drive_robust.verdict.model import Requirement

__all__ = ["advice_on", "by_evidence", "margin_of", "reads_routes", "rule_of"]

_SCORE_RANGE = 100.0


def reads_routes(requirement: Requirement, verdict_rule: VerdictRule) -> bool:
    """Whether the verdict is read route by route; a user's function over all episodes cannot be."""
    return verdict_rule.kind != "point" and known_metric(requirement.metric).function is None


def by_evidence(requirements: Sequence[Requirement], verdict_rule: VerdictRule) -> int:
    """How many verdicts from evidence a test will give: those of its `requirements`, one when they are not known."""
    if verdict_rule.kind != "evidence":
        return 0
    return sum(reads_routes(requirement, verdict_rule) for requirement in requirements) if requirements else 1


def margin_of(requirement: Requirement, verdict_rule: VerdictRule) -> float:
    """The margin in the unit of the metric."""
    return verdict_rule.margin * _range_of(requirement)


def rule_of(requirement: Requirement, verdict_rule: VerdictRule) -> Rule:
    """The requirement as linear forms of one route's scores (see `stats.rules`)."""
    from pytest_drive_robust.stats.rules import degradation_rule, mean_rule

    metric = known_metric(requirement.metric)
    margin = margin_of(requirement, verdict_rule)
    if metric.needs_clean:
        return degradation_rule(requirement.limit, margin, comparison=requirement.comparison)
    return mean_rule(requirement.limit, requirement.comparison, margin=margin, low=metric.low, high=metric.high)


def advice_on(requirement: Requirement, verdict_rule: VerdictRule, routes: int) -> Advice:
    """What so many routes can show of it, by the usual noise; nothing to say where no evidence is asked for."""
    from pytest_drive_robust.stats.planning import USUAL_NOISE, Advice, advise

    if verdict_rule.kind != "evidence" or not reads_routes(requirement, verdict_rule):
        return Advice("fine", "", 0.0)
    scale = _range_of(requirement)
    return advise(
        routes, margin_of(requirement, verdict_rule), USUAL_NOISE * scale, what=requirement.metric, scale=scale,
        alpha=verdict_rule.alpha,
    )  # fmt: skip


def _range_of(requirement: Requirement) -> float:
    metric = known_metric(requirement.metric)
    if metric.needs_clean:
        return 1.0
    span = metric.high - metric.low
    return span if math.isfinite(span) else _SCORE_RANGE
