"""Three verdicts from evidence: does the requirement hold on routes like these?

A requirement becomes two linear forms of one route's scores (`LinearForms`), read in planned order. `hold` has a mean
of 0 or more exactly when the requirement holds; `slack` has a mean above 0 exactly when it is missed by less than the
margin. For RD <= limit the forms are `P - (1 - limit) * C` and `P - (1 - limit - margin) * C` (P: perturbed score, C:
clean score); both are linear in the scores, so nothing is divided. Both comparisons, and every metric that is a mean
over routes or the ratio of two means, become a pair of forms, so one judge serves all requirements.

After every route a betting e-process may decide (alpha / 5; valid after any number of looks: Waudby-Smith and Ramdas
2024, "Estimating means of bounded random variables by betting"). When the routes run out, Hall's skewness-corrected t
test takes one last look (alpha * 4 / 5; Hall 1992, "On the removal of skewness by transformation"). Rare routes that
were not drawn would make that test too sure. So the pass side reads one pessimistic pseudo route more, and a fail must
also stand against the chance that just the routes which make up for the others were not drawn (`unseen_p`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum
from typing import Literal, NamedTuple

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.quantiles import student_t_chance

Decision = Literal["pass", "fail", "inconclusive"]

BETS = (0.2, 0.5, 0.9)
"""The share of their wealth that the three gamblers stake. The bold wins far from the limit, the shy near the limit."""

EARLY_SHARE = 0.2
"""The share of alpha that betting after every route may spend; the rest is for the last look."""

FEWEST_FOR_T = 20
"""The fewest routes for the t test. Fewer two-humped scores have no usable t statistic: betting alone decides."""

TOP_SCORE = 100.0
"""The highest driving score."""

_SHY, _FAIR, _BOLD = BETS
_ROUNDING = 1e-12
_ERRORS = tuple(0.5 * step for step in range(-8, 6))
"""Standard errors by which the true mean of the drawn kinds may lie below the mean of the routes drawn (-4 to 2.5)."""
_MOST_ERRORS = 3.0
"""Standard errors below the mean of the routes drawn that the true mean as good as never reaches."""
_ALL_OF_IT = 1.0 - 1e-9
"""A margin of this share of the way to the range's end uses all of it. Below 1, as 1 - 0.7 is rounded above 0.3."""


class Wealth:
    """The mean wealth of three gamblers who bet on "the mean of x is above 0", for values x >= -1.

    `value` is the e-value of the evidence so far. If the mean of x is 0 at most, `value` reaches 100 with a chance of 1
    in 100 at most.
    """

    __slots__ = ("_owned", "value")

    def __init__(self) -> None:
        self._owned = (1.0, 1.0, 1.0)
        self.value = 1.0

    def bet(self, x: float) -> float:
        """Bet on one more value and return the wealth. Raises `ComparisonError` below -1 and for NaN."""
        if not x >= -1.0:
            if not x > -1.0 - 1e-9:
                raise ComparisonError(f"a value of {x!r} lies outside the range that its scores can have.")
            x = -1.0
        low, middle, high = self._owned
        low, middle, high = low * (1.0 + _SHY * x), middle * (1.0 + _FAIR * x), high * (1.0 + _BOLD * x)
        self._owned = low, middle, high
        self.value = (low + middle + high) / 3.0
        return self.value


def share_of(bound: float, x: float) -> float:
    """Return `x` as a share of `bound`, -1 or more; with a `bound` of 0 any `x` above 0 is proof (infinity)."""
    if bound > 0.0:
        return x / bound
    return math.inf if x > 0.0 else x


def mean_below_zero_p(values: Sequence[float], *, scale: float = 1.0) -> float:
    """Return the p-value against "the mean is 0 or more" by Hall's transformed t statistic; small: the mean is below 0.

    Takes two values or more. Equal values are as good as certain; zeros say nothing (0.5). `scale` is the size of the
    numbers that the values were computed from: a value below 1e-12 of `scale` is rounding and counts as 0.
    """
    sample = _Sample.of(values, scale)
    return sample.below_zero_p(sample.mean)


def unseen_p(holds: Sequence[float], most: float, *, scale: float = 1.0) -> float:
    """Return the p-value against "the requirement holds, thanks to a kind of routes that was never drawn".

    `most` is the hold of an undrawn route, above 0. If the other routes have a mean of -s, the requirement holds when a
    share of s / (most + s) or more of all routes is of the undrawn kind. The chance that a sample contains none of that
    kind is (most / (most + s)) ** routes; Hall's test gives the chance that the other routes look as bad as they do.
    The p-value is the largest product of the two chances over all s. So twenty routes that fail say little about a
    success rate of 0.05. With much spread or many routes the p-value is that of Hall's test alone: one route of the
    best kind then moves the mean by less than half of its standard error.
    """
    sample = _Sample.of(holds, scale)

    def none_of(short: float) -> float:
        return (most / (most + short)) ** sample.size if short > 0.0 else 1.0

    chances = [sample.below_zero_p(sample.mean), none_of(_MOST_ERRORS * sample.error - sample.mean)]
    off = (errors * sample.error for errors in _ERRORS)
    chances += [sample.below_zero_p(by) * none_of(by - sample.mean) for by in off if by > sample.mean]
    return max(chances)


def last_fail_p(holds: Sequence[float], most: float, *, scale: float = 1.0) -> float:
    """Return the p-value of the last look against "the requirement holds"; a p-value of alpha or less is a fail.

    Takes `FEWEST_FOR_T` holds or more. Hall's test spends the alpha that betting leaves. The test of undrawn routes
    (`unseen_p`) spends all of alpha, because betting hardly ever decides where such routes count; it is left out where
    the range has no end (`most` is infinite), so that no bound is known, and where `most` is 0.
    """
    p_value = mean_below_zero_p(holds, scale=scale) / (1.0 - EARLY_SHARE)
    return max(p_value, unseen_p(holds, most, scale=scale)) if 0.0 < most < math.inf else p_value


def last_pass_p(slacks: Sequence[float], least: float, *, scale: float = 1.0) -> float:
    """Return the p-value of the last look against "the limit is missed by the margin or more"; alpha or less is a pass.

    Reads one pessimistic route more, with the worst slack of the range, `-least`. If the range has no end, that route
    lies as far out as the farthest route seen.
    """
    worst = least if least < math.inf else max(map(abs, slacks))
    return mean_below_zero_p([*(-slack for slack in slacks), worst], scale=scale) / (1.0 - EARLY_SHARE)


class _Sample(NamedTuple):
    """The statistics of a sample that Hall's test reads: size, mean, standard error of the mean, spread, skewness."""

    size: int
    mean: float
    error: float
    spread: float
    skew: float

    @classmethod
    def of(cls, values: Sequence[float], scale: float) -> _Sample:
        values = [value if abs(value) > _ROUNDING * scale else 0.0 for value in values]
        count, mean = len(values), fsum(values) / len(values)
        off = [value - mean for value in values]
        spread = math.sqrt(fsum([by * by for by in off]) / count)
        skew = fsum([by * by * by for by in off]) / count / max(spread, 1e-6) ** 3
        return cls(count, mean, spread / math.sqrt(count - 1), spread, skew)

    def below_zero_p(self, mean: float) -> float:
        """Return the p-value against "the mean is 0 or more" for these values, shifted to have the mean `mean`."""
        count, skew = self.size, self.skew
        share = mean / max(self.spread * math.sqrt(count / (count - 1)), 1e-9 * max(abs(mean), 1e-9))
        share = max(-1e6, min(1e6, share))
        straight = share + skew * share**2 / 3.0 + skew**2 * share**3 / 27.0 + skew / (6.0 * count)
        return student_t_chance(count - 1, straight * math.sqrt(count))


@dataclass(frozen=True, slots=True)
class LinearForms:
    """The two forms: `hold = sign * (score - keep * reference - base)`, and `slack` with the lenient keep and base.

    `hold` lies in `-floor..most`, `slack` in `-least..` (all three are 0 or more, infinite where a range has no end).
    `relative` forms read a reference score beside every score and decide nothing while all references are 0.
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
        """Return the value of one route whose mean is 0 or more exactly when the requirement holds."""
        return self.sign * (score - self.keep * reference - self.base)

    def slack(self, score: float, reference: float = 0.0) -> float:
        """Return the value of one route whose mean is above 0 exactly when the limit is missed by less than margin."""
        return self.sign * (score - self.lenient_keep * reference - self.lenient_base)

    @property
    def scale(self) -> float:
        """The larger finite bound of `hold` (`most` or `floor`); 1 when neither is finite and above 0."""
        return max((bound for bound in (self.most, self.floor) if 0.0 < bound < math.inf), default=1.0)

    @property
    def top_reference(self) -> float:
        """The top score of relative forms."""
        return self.most if self.sign > 0.0 else self.floor


def degradation_forms(
    limit: float, margin: float = 0.10, *, comparison: str = "<=", top_score: float = TOP_SCORE
) -> LinearForms:
    """Return the forms of RD = 1 - mean(score) / mean(reference) against `limit`, for scores 0..`top_score`.

    The reference is the clean run, or a stored run of the same setting: "not worse than last week by more than 5 %" is
    `degradation_forms(0.05)`. A margin that would reach RD 1, where everything passes, is cut to half the way there.

    Raises `ValueError` for a limit that no agent can miss or that is no number, a margin of 0 or less, and another
    comparison than `"<="` and `">="`.
    """
    _require(comparison, margin)
    keep = 1.0 - limit
    if comparison == "<=":
        if not 0.0 < keep < math.inf:
            raise ValueError(f"expected a threshold below 1 and a margin above 0, not {limit!r} and {margin!r}.")
        lenient = keep - margin if margin < keep * _ALL_OF_IT else 0.5 * keep
        return LinearForms(1.0, keep, 0.0, lenient, 0.0, top_score, top_score * keep, top_score * lenient, True)
    if not 0.0 <= keep < math.inf:
        raise ValueError(f"expected a threshold of 1 at most and a margin above 0, not {limit!r} and {margin!r}.")
    return LinearForms(-1.0, keep, 0.0, keep + margin, 0.0, top_score * keep, top_score, top_score, True)


def mean_forms(
    limit: float, comparison: str, *, margin: float, low: float = -math.inf, high: float = math.inf
) -> LinearForms:
    """Return the forms of a mean over routes against `limit`, for values in `low..high`.

    For DS (0..100), SR (0..1), comfort and efficiency.

    A range without an end gives no early verdict on the side that needs that end: clipping the values there would move
    their mean. `efficiency >= 60` (0 or more, no upper end) can pass early and fails in the last look only.
    The margin has the unit of the metric. A margin that would leave the range, where everything passes, is cut to half
    the way to its end. For differences to a stored run give the limit `-allowed_drop` and the range of the difference.

    Raises `ValueError` for a limit outside the range, a margin of 0 or less, and another comparison than `"<="` and
    `">="`.
    """
    _require(comparison, margin)
    if not (math.isfinite(limit) and low <= limit <= high):
        raise ValueError(f"the limit is {limit!r}, expected a finite number in {low:g}..{high:g}.")
    sign = 1.0 if comparison == ">=" else -1.0
    below, above = (limit - low, high - limit) if comparison == ">=" else (high - limit, limit - low)
    give = margin if margin < below * _ALL_OF_IT or below == 0.0 else 0.5 * below  # what cannot be missed needs no cut
    return LinearForms(sign, 0.0, limit, 0.0, limit - sign * give, above, below, max(0.0, below - give), False)


def _require(comparison: str, margin: float) -> None:
    if comparison not in ("<=", ">="):
        raise ValueError(f"{comparison!r} compares nothing. Expected '<=' or '>='.")
    if not 0.0 < margin < math.inf:
        raise ValueError(f"the margin is {margin!r}, expected a number above 0 such as 0.10.")


def fail_p_value(
    forms: LinearForms, scores: Sequence[float], references: Sequence[float] = (), *, ended: bool = True
) -> float:
    """Return the p-value against "the requirement holds", for the routes read so far in order; alpha or less is a fail.

    The p-value is the fail side of the evidence verdict as a number: the largest e-value may spend a fifth of alpha,
    the last look the rest. With `ended` False the last look is still to come and only betting counts. Holm's procedure
    needs smaller p-values than a single verdict, so read all routes for Holm instead of stopping at the verdict.
    """
    if forms.relative and not any(reference > 0.0 for reference in references):
        return 1.0
    holds = [
        forms.hold(score, reference)
        for score, reference in zip(scores, references if forms.relative else [0.0] * len(scores), strict=True)
    ]
    wealth = Wealth()
    largest = max((wealth.bet(share_of(forms.most, -hold)) for hold in holds), default=1.0)
    p_value = 1.0 / (EARLY_SHARE * largest)
    if ended and len(holds) >= FEWEST_FOR_T:
        p_value = min(p_value, last_fail_p(holds, forms.most, scale=forms.scale))
    return min(1.0, p_value)
