"""Shrinks a broken requirement to the smallest setting that breaks it, on the episodes of a run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.verdict.known import known_metric
from pytest_drive_robust.verdict.model import Requirement
from pytest_drive_robust.verdict.shrink import MinimalFailure, minimal_failing

if TYPE_CHECKING:
    from pytest_drive_robust.domain.verdict_rule import VerdictRule
    from pytest_drive_robust.perturbations.base import Setting
    from pytest_drive_robust.runner.campaign import Campaign
    from pytest_drive_robust.runner.plan import Scope

__all__ = ["minimal_failure"]


def minimal_failure(
    requirement: Requirement, campaign: Campaign, *, scope: Scope, verdict_rule: VerdictRule, dt_s: float
) -> MinimalFailure | None:
    """The smallest setting under which `requirement` fails, or None when it does not fail in the first place.

    Evidence is asked for more strictly than for one verdict: alpha is shared by the calls that shrinking may take,
    about two for each failure in the stack.
    """
    setting = requirement.setting
    if campaign.decide(requirement, scope, verdict_rule).verdict.decision != "fail" or setting.is_clean:
        return None
    strict = replace(verdict_rule, alpha=verdict_rule.alpha / (2.0 * len(setting.perturbations)))

    def fails(candidate: Setting) -> str:
        asked = Requirement(requirement.metric, candidate, requirement.comparison, requirement.limit)
        return campaign.decide(asked, scope, verdict_rule if candidate == setting else strict).verdict.decision

    limit = known_metric(requirement.metric).format_limit(requirement.limit)
    sentence = f"{requirement.metric} under {{setting}} {requirement.comparison} {limit}"
    return minimal_failing(setting, fails, dt_s=dt_s, sentence=sentence)
