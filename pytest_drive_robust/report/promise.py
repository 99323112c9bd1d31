"""The words of every report for what a verdict shows, on which routes, and how often the verdict is wrong."""

from __future__ import annotations

from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.report.numbers import counted, in_percent

OPEN = "not shown to be broken, nor to hold within its margin"
"""The reason of an inconclusive verdict without its own message."""


def confidence(rule: str, alpha: float) -> float:
    """Return the confidence (0..1) of a verdict's interval: 1 - 2 * `alpha` by evidence, else 0.95."""
    return 1.0 - 2.0 * alpha if rule == "evidence" else 0.95


def claims(metric: Metric, comparison: str, *, limit: float, lenient: float) -> tuple[str, str]:
    """Return (the claim of a fail, the claim of a pass) from evidence; a pass claims the limit `lenient`."""
    above = comparison == "<="
    broken = f"{metric} {'>' if above else '<'} {metric.format_limit(limit)}"
    return broken, f"{metric} {'<' if above else '>'} {metric.format_limit(lenient)}"


def shown_by_evidence(claim: str, verdict: str, *, alpha: float, family: int) -> str:
    """Return the promise of a pass or a fail from evidence; `family` is how many requirements a fail stands among."""
    if verdict == "fail" and family > 1:
        return f"{claim} on routes like these; any wrong fail among {family}: at most {in_percent(alpha)}%"
    return f"{claim} on routes like these, wrong at most {in_percent(alpha)}% of the time"


def of_these_routes(rule: str, *, routes: int, planned: int, alpha: float) -> str:
    """Return what a verdict by the rule list or point shows, which holds only for the given routes."""
    these = f"exactly these {counted(planned, 'route')} and their seeds, not for others"
    if rule == "point":
        return f"compared with the limit for {these}"
    if routes < planned:
        return f"decided for {these}, before all were driven: wrong at most {in_percent(alpha)}% of the time"
    return f"decided for {these}"
