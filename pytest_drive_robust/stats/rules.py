"""A requirement as two linear forms of one route's scores: what the judges read.

`hold` has a mean of 0 or more exactly when the requirement holds, `slack` has a mean above 0 exactly when it is missed
by less than the margin. Both sides of a comparison and every metric that is a mean over routes, or the ratio of two,
become such a pair, so one judge serves them all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pytest_drive_robust.stats.evidence import Evidence

__all__ = ["Rule", "degradation_rule", "mean_rule"]

_TOP_SCORE = 100.0
_ALL_OF_IT = 1.0 - 1e-9
"""Below this share a margin leaves something of the range, and not only by rounding: 1 - 0.7 is more than 0.3."""


@dataclass(frozen=True, slots=True)
class Rule:
    """`hold = sign * (score - keep * reference - base)`; `slack` the same with the lenient numbers.

    `hold` lies in `-floor..most`, `slack` in `-least..` (all three 0 or more, infinity where a range has no end).
    A `relative` rule reads a reference score beside every score and says nothing while all references are 0.
    """

    sign: float
    keep: float
    base: float
    lenient_keep: float
    lenient_base: float
    most: float
    floor: float
    least: float
    relative: bool

    def hold(self, score: float, reference: float = 0.0) -> float:
        """The value of one route whose mean is 0 or more exactly when the requirement holds."""
        return self.sign * (score - self.keep * reference - self.base)

    def slack(self, score: float, reference: float = 0.0) -> float:
        """The value of one route whose mean is above 0 exactly when the limit is missed by less than the margin."""
        return self.sign * (score - self.lenient_keep * reference - self.lenient_base)

    @property
    def scale(self) -> float:
        """The larger end of what `hold` can be that is finite; 1 when neither is."""
        return max((bound for bound in (self.most, self.floor) if 0.0 < bound < math.inf), default=1.0)

    def evidence(self, alpha: float = 0.05, *, fail_alpha: float | None = None) -> Evidence:
        """A new collector for this rule."""
        return Evidence(most=self.most, least=self.least, alpha=alpha, fail_alpha=fail_alpha)


def degradation_rule(
    limit: float, margin: float = 0.10, *, comparison: str = "<=", top_score: float = _TOP_SCORE
) -> Rule:
    """RD = 1 - mean(score) / mean(reference) against `limit`, for scores 0..`top_score`.

    The reference is the clean run, or a stored run of the same setting: "not worse than last week by more than 5 %" is
    `degradation_rule(0.05)`. A margin that would reach RD 1, where everything passes, is cut to half the way there.

    Raises `ValueError` for a limit that no agent can miss or that is no number, a margin of 0 or less, and another
    comparison than `"<="` and `">="`.
    """
    _require(comparison, margin)
    keep = 1.0 - limit
    if comparison == "<=":
        if not 0.0 < keep < math.inf:
            raise ValueError(f"expected a threshold below 1 and a margin above 0, not {limit!r} and {margin!r}.")
        lenient = keep - margin if margin < keep * _ALL_OF_IT else 0.5 * keep
        return Rule(1.0, keep, 0.0, lenient, 0.0, top_score, top_score * keep, top_score * lenient, True)
    if not 0.0 <= keep < math.inf:
        raise ValueError(f"expected a threshold of 1 at most and a margin above 0, not {limit!r} and {margin!r}.")
    return Rule(-1.0, keep, 0.0, keep + margin, 0.0, top_score * keep, top_score, top_score, True)


def mean_rule(
    limit: float,
    comparison: str,
    *,
    margin: float,
    low: float = -math.inf,
    high: float = math.inf,
) -> Rule:
    """The mean over routes of values in `low..high` against `limit`: DS (0..100), SR (0..1), comfort, efficiency.

    A range that has no end gives no early verdict on the side that needs it: clipping the values there would move
    their mean. `efficiency >= 60` (0 or more, no upper end) can pass early and fails in the last look only.
    The margin has the unit of the metric. One that would leave the range, where everything passes, is cut to half the
    way to its end. For differences to a stored run give the limit `-allowed_drop` and the range of the difference.

    Raises `ValueError` for a limit outside the range, a margin of 0 or less, and another comparison than `"<="` and
    `">="`.
    """
    _require(comparison, margin)
    if not (math.isfinite(limit) and low <= limit <= high):
        raise ValueError(f"the limit is {limit!r}, expected a finite number in {low:g}..{high:g}.")
    sign = 1.0 if comparison == ">=" else -1.0
    below, above = (limit - low, high - limit) if comparison == ">=" else (high - limit, limit - low)
    give = margin if margin < below * _ALL_OF_IT or below == 0.0 else 0.5 * below  # what cannot be missed needs no cut
    return Rule(sign, 0.0, limit, 0.0, limit - sign * give, above, below, max(0.0, below - give), False)


def _require(comparison: str, margin: float) -> None:
    if comparison not in ("<=", ">="):
        raise ValueError(f"{comparison!r} compares nothing. Expected '<=' or '>='.")
    if not 0.0 < margin < math.inf:
        raise ValueError(f"the margin is {margin!r}, expected a number above 0 such as 0.10.")
