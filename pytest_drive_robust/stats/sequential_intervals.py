"""Intervals that stay honest after an early stop: every threshold against which betting has not won.

A fixed-n interval of a run that stopped because it looked clear is too sure. Wealth is not: whatever the rule by which
the reading stopped, wealth against the truth is 1 / alpha or more with a chance of alpha at most. So the thresholds
with less wealth than that hold the truth with a chance of 1 - alpha a side. Wealth at a threshold grows with the
distance to it, so the ends are found by bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import EARLY_SHARE, FEWEST_FOR_T, Wealth, mean_below_zero_p

__all__ = ["evidence_interval", "mean_evidence_interval"]

_STEPS = 36
_FARTHEST = 1e6


def evidence_interval(
    clean: Sequence[float],
    perturbed: Sequence[float],
    alpha: float = 0.05,
    *,
    ended: bool = False,
    top_score: float = 100.0,
) -> tuple[float, float]:
    """The interval of RD = 1 - mean(perturbed) / mean(clean) from pairs that may have stopped early, `alpha` a side.

    Scores are 0..`top_score`, one per route. Contains the RD of the means, ends at 1 at most, is wider for a smaller
    alpha, and does not depend on the order. The lower end may be far below 0 after a few pairs.

    `ended` says that the planned routes ran out, so the gate took its last look. The ends then are where the gate
    itself would turn: a fail has `limit <= low`, a pass `high <= limit + margin` (early verdicts have that anyway).
    Either kind misses the truth at most `alpha` of the time on each side. Choosing the kind by how the run ended, as a
    report does, could double that at worst; in the study of `tests/calibration/` it stays below alpha.

    Raises `ComparisonError` for lists that do not pair, no pair, and a clean mean of 0.
    """
    if len(clean) != len(perturbed) or not clean:
        raise ComparisonError(f"{len(clean)} clean and {len(perturbed)} perturbed values. Expected one pair or more.")
    total = math.fsum(clean)
    if not total > 0.0:
        raise ComparisonError("the mean clean score is 0, so the degradation is undefined.")
    pairs = [(before / top_score, after / top_score) for before, after in zip(clean, perturbed, strict=True)]
    rd = 1.0 - math.fsum(perturbed) / total

    def too_low(threshold: float) -> bool:
        keep = 1.0 - threshold
        return _rejects([keep * before - after for before, after in pairs], 1.0, alpha, ended)

    def too_high(threshold: float) -> bool:
        keep = 1.0 - threshold
        return _rejects([after - keep * before for before, after in pairs], keep, alpha, ended, unseen=True)

    return _edge(rd, -math.inf, too_low), min(1.0, _edge(rd, 1.0, too_high))


def mean_evidence_interval(
    values: Sequence[float], alpha: float = 0.05, *, low: float, high: float, ended: bool = False
) -> tuple[float, float]:
    """The same for a mean over routes of values in `low..high`: SR (0..1), DS and comfort (0..100).

    An end of the range may be infinite (efficiency has no upper end): the end of the interval that would need it, the
    upper one, is then infinite too until the last look.

    Raises `ComparisonError` for no value and for one outside the range.
    """
    if not values or not all(low <= value <= high for value in values):
        raise ComparisonError(f"expected one value or more, all in {low:g}..{high:g}.")
    mean = min(high, max(low, math.fsum(values) / len(values)))

    def too_low(limit: float) -> bool:
        return _rejects([value - limit for value in values], limit - low, alpha, ended, unseen=True)

    def too_high(limit: float) -> bool:
        return _rejects([limit - value for value in values], high - limit, alpha, ended, unseen=True)

    return _edge(mean, low, too_low), _edge(mean, high, too_high)


def _rejects(gains: Sequence[float], worst: float, alpha: float, ended: bool, *, unseen: bool = False) -> bool:
    """Whether "the mean of the gains is 0 at most" is given up; no gain is below `-worst`."""
    if not worst > 0.0:
        return any(gain > 0.0 for gain in gains)
    if _wealth(gains, worst) * alpha * (EARLY_SHARE if ended else 1.0) >= 1.0:
        return True
    if not ended or len(gains) < FEWEST_FOR_T:
        return False
    scale = worst if worst < math.inf else max(map(abs, gains))
    pseudo = [scale] if unseen else []
    return mean_below_zero_p([*(-gain for gain in gains), *pseudo], scale=scale) <= alpha * (1.0 - EARLY_SHARE)


def _wealth(gains: Sequence[float], worst: float) -> float:
    wealth = Wealth()
    for gain in gains:
        wealth.bet(max(-1.0, gain / worst))
    return wealth.value


def _edge(inside: float, end: float, rejects: Callable[[float], bool]) -> float:
    """Where `rejects` turns between `inside`, which is never rejected, and `end`; `end` when it does not turn."""
    outside = end
    if math.isinf(end):
        step = math.copysign(1.0 / 64.0, end) * max(1.0, abs(inside))
        while not rejects(outside := inside + step):
            if abs(step) > _FARTHEST * max(1.0, abs(inside)):
                return end
            step *= 2.0
    elif not rejects(end):
        return end
    for _ in range(_STEPS):
        middle = 0.5 * (inside + outside)
        if rejects(middle):
            outside = middle
        else:
            inside = middle
    return outside
