"""What a verdict says, of which routes, and how often that is wrong: the same in every report."""

from __future__ import annotations

from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.report.numbers import counted

OPEN = "not shown to be broken, nor to hold within its margin"
"""What is said of an inconclusive verdict that has no message of its own."""


def confidence(rule: str, alpha: float) -> float:
    """Return how sure the interval of a verdict is: `alpha` is left on each side where evidence was read."""
    return 1.0 - 2.0 * alpha if rule == "evidence" else 0.95


def claims(metric: Metric, comparison: str, *, limit: float, lenient: float) -> tuple[str, str]:
    """Return what a fail from evidence shows and what a pass shows, whose limit is `lenient`."""
    above = comparison == "<="
    broken = f"{metric} {'>' if above else '<'} {metric.format_limit(limit)}"
    return broken, f"{metric} {'<' if above else '>'} {metric.format_limit(lenient)}"


def shown_by_evidence(claim: str, verdict: str, *, alpha: float, family: int) -> str:
    """Return the promise of a pass or a fail from evidence; `family` is among how many a fail had to stand."""
    if verdict == "fail" and family > 1:
        return f"{claim} on routes like these; any wrong fail among {family}: at most {alpha:.0%}"
    return f"{claim} on routes like these, wrong at most {alpha:.0%} of the time"


def of_these_routes(rule: str, *, routes: int, planned: int, alpha: float) -> str:
    """Return what a verdict by the rules list and point says, which speak of the routes that were given only."""
    these = f"exactly these {counted(planned, 'route')} and their seeds, not for others"
    if rule == "point":
        return f"compared with the limit for {these}"
    if routes < planned:
        return f"decided for {these}, before all were driven: wrong at most {alpha:.0%} of the time"
    return f"decided for {these}"
