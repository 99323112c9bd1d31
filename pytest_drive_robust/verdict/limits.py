"""The limit of a requirement: which limits a metric can have, and what the margin of a rule adds to one."""

from __future__ import annotations

import math

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.severity_text import render_value
from pytest_drive_robust.stats.evidence import LinearForms, degradation_forms, mean_forms

DIGITS = 12
"""The decimals of a limit or margin; further ones are rounding: 0.3 + 0.1 - 0.3 is 0.10000000000000003."""


def checked_limit(metric: Metric, comparison: str, limit: float) -> float:
    """Return the limit as a float. Raises `RequirementError` if the metric cannot reach or cannot miss the limit."""
    try:
        number = float(limit)
    except (TypeError, ValueError, OverflowError):
        raise RequirementError(f"the limit of {metric.name} is {limit!r}, expected a number.") from None
    # RD has no lower end, but a perturbed score of twice the clean one is a mistake in the sentence, not a wish.
    low, high = (-1.0, 1.0) if metric.needs_clean else (metric.low, metric.high)
    if not math.isfinite(number) or not low <= number <= high:
        told = f"the limit of {metric.name} is {render_value(number)}"
        raise RequirementError(f"{told}, expected {_range(low, high)}.")
    if metric.needs_clean and number == low:
        raise RequirementError(f"the limit of {metric.name} is {number:g}, expected a number above {low:g}.")
    always = metric.high if comparison == "<=" else metric.low
    if number == always:
        raise RequirementError(
            f"{metric.name} {comparison} {number:g} holds for every agent, so it can never fail. "
            f"Expected a limit {'below' if comparison == '<=' else 'above'} {number:g}."
        )
    return number + 0.0  # -0.0 would print as "-0"


def _range(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "a finite number"
    return f"{low:g} or more" if math.isinf(high) else f"a number in {low:g}..{high:g}"


def lenient_limit(metric: Metric, comparison: str, limit: float, verdict_rule: VerdictRule) -> float:
    """Return the limit with the margin added, which a pass from evidence is better than; cut at the end of the range.

    `DS >= 5` with a margin of 10 is judged against 2.5, because every agent is better than -5.
    """
    forms = linear_forms(metric, comparison, limit, verdict_rule)
    return round(1.0 - forms.lenient_keep if forms.relative else forms.lenient_base, DIGITS)


def linear_forms(metric: Metric, comparison: str, limit: float, verdict_rule: VerdictRule) -> LinearForms:
    """Return the linear forms of one route's scores that the judges of `stats` read."""
    margin = verdict_rule.margin * metric.span
    if metric.needs_clean:
        return degradation_forms(limit, margin, comparison=comparison)
    return mean_forms(limit, comparison, margin=margin, low=metric.low, high=metric.high)
