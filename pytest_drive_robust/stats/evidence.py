"""Three verdicts from evidence: does the requirement hold on routes like these?

A requirement becomes two linear forms of one route's scores (`LinearForms`), read in planned order. `hold` has a mean
of 0 or more exactly when the requirement holds; `slack` has a mean above 0 exactly when it is missed by less than the
margin. For RD <= limit these are `P - (1 - limit) * C` and `P - (1 - limit - margin) * C`: linear in the scores, so
nothing is divided. Both sides of a comparison and every metric that is a mean over routes, or the ratio of two, become
such a pair, so one judge serves them all.

After every route a betting e-process may decide (alpha / 5; valid however often one looks: Waudby-Smith and Ramdas
2024, "Estimating means of bounded random variables by betting"). When the routes run out there is one look with Hall's
skewness-corrected t test (alpha * 4 / 5; Hall 1992, "On the removal of skewness by transformation"), with one
pessimistic pseudo route on the pass side, because rare failures that were not seen yet would make it too sure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum
from typing import Literal

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.quantiles import student_t_chance

__all__ = [
    "BETS",
    "EARLY_SHARE",
    "FEWEST_FOR_T",
    "Decision",
    "Evidence",
    "LinearForms",
    "Wealth",
    "degradation_forms",
    "fail_p_value",
    "mean_below_zero_p",
    "mean_forms",
    "share_of",
]

Decision = Literal["pass", "fail", "inconclusive"]

BETS = (0.2, 0.5, 0.9)
"""The shares of what they own that the three gamblers stake: far from the limit the bold one wins, near it the shy."""

EARLY_SHARE = 0.2
"""The share of alpha that betting after every route may spend; the rest is for the last look."""

FEWEST_FOR_T = 20
"""Fewer two-humped scores have no usable t statistic: then betting alone decides."""

_SHY, _FAIR, _BOLD = BETS
_ROUNDING = 1e-12
_TOP_SCORE = 100.0
_ALL_OF_IT = 1.0 - 1e-9
"""Below this share a margin leaves something of the range, and not only by rounding: 1 - 0.7 is more than 0.3."""


class Wealth:
    """What three gamblers own on average who bet on "the mean of x is above 0", for x >= -1 whose mean is 0 at most.

    `value` is the e-value of the evidence so far: 100 is reached with a chance of 1 in 100 at most.
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


class Evidence:
    """Collects routes in planned order until they decide.

    `most` is the largest value that `hold` can take, `least` the smallest one of `slack`, as a positive number.
    Infinity where there is no end: that side then waits for the last look. 0 where the other sign is impossible: one
    route on the wrong side is then proof. `alpha` bounds the chance of a wrong fail, and that of a wrong pass. With a
    `fail_alpha` below it a fail takes more; what would be a fail at `alpha` only is then inconclusive.
    `against` and `within` hold the e-values of the two sides, `needed_for_fail` and `needed` decide.

    Raises `ValueError` for a range that is negative or an alpha outside 0..0.5.
    """

    def __init__(self, *, most: float, least: float, alpha: float = 0.05, fail_alpha: float | None = None) -> None:
        if not (most >= 0.0 and least >= 0.0):
            raise ValueError(f"the ranges are {most!r} and {least!r}, expected two numbers of 0 or more.")
        if not 0.0 < alpha < 0.5:
            raise ValueError(f"alpha is {alpha!r}, expected a number between 0 and 0.5 such as 0.05.")
        fail_alpha = alpha if fail_alpha is None else fail_alpha
        if not 0.0 < fail_alpha <= alpha:
            raise ValueError(f"the alpha of a fail is {fail_alpha!r}, expected a number above 0, {alpha} at most.")
        self._most, self._least, self._alpha, self._fail_alpha = most, least, alpha, fail_alpha
        self.needed, self.needed_for_fail = 1.0 / (alpha * EARLY_SHARE), 1.0 / (fail_alpha * EARLY_SHARE)
        self.against, self.within = Wealth(), Wealth()
        self._holds: list[float] = []
        self._slacks: list[float] = []
        self.decision: Decision | None = None

    @property
    def routes(self) -> int:
        """How many routes were read."""
        return len(self._holds)

    def read(self, hold: float, slack: float) -> Decision | None:
        """Read one more route; return the verdict as soon as there is one. Later routes change nothing any more.

        Raises `ComparisonError` for a value outside the range.
        """
        if self.decision is not None:
            return self.decision
        against = self.against.bet(share_of(self._most, -hold))
        within = self.within.bet(share_of(self._least, slack))
        self._holds.append(hold)
        self._slacks.append(slack)
        if against >= self.needed_for_fail:
            self.decision = "fail"
        elif within >= self.needed:
            self.decision = "pass"
        return self.decision

    def close(self) -> Decision:
        """Take the last look, once there are no more routes. Raises `ComparisonError` when none was read."""
        if not self._holds:
            raise ComparisonError("there is no route to judge. Expected one score per route.")
        if self.decision is None:
            self.decision = self._last_look()
        return self.decision

    def _last_look(self) -> Decision:
        late = 1.0 - EARLY_SHARE
        scale = max((bound for bound in (self._most, self._least) if bound < math.inf), default=1.0)
        if self.routes >= FEWEST_FOR_T:
            p_value = mean_below_zero_p(self._holds, scale=scale)
            if p_value <= self._alpha * late:
                return "fail" if p_value <= self._fail_alpha * late else "inconclusive"
            if 1.0 - mean_below_zero_p([*self._slacks, self._unseen()], scale=scale) <= self._alpha * late:
                return "pass"
        return "inconclusive"

    def _unseen(self) -> float:
        """Return the pseudo route: the worst that the range allows.

        Without an end it is as far out as the farthest route seen.
        """
        return -self._least if self._least < math.inf else -max(abs(slack) for slack in self._slacks)


def share_of(bound: float, x: float) -> float:
    """Return `x` as a share of `bound`, so that it is -1 at least; with a bound of 0 anything above 0 is proof."""
    if bound > 0.0:
        return x / bound
    return math.inf if x > 0.0 else x


def mean_below_zero_p(values: Sequence[float], *, scale: float = 1.0) -> float:
    """Return the p-value against "the mean is 0 or more" by Hall's transformed t statistic; small: the mean is below 0.

    For two values or more. Values that are all the same are as good as certain, zeros say nothing (0.5). `scale` is
    what the values were computed from: less than a billionth of a thousandth of it is rounding, thus 0.
    """
    values = [value if abs(value) > _ROUNDING * scale else 0.0 for value in values]
    count, mean = len(values), fsum(values) / len(values)
    spread = math.sqrt(fsum((value - mean) ** 2 for value in values) / count)
    share = mean / max(spread * math.sqrt(count / (count - 1)), 1e-9 * max(abs(mean), 1e-9))
    share = max(-1e6, min(1e6, share))
    skew = fsum((value - mean) ** 3 for value in values) / count / max(spread, 1e-6) ** 3
    straight = share + skew * share**2 / 3.0 + skew**2 * share**3 / 27.0 + skew / (6.0 * count)
    return student_t_chance(count - 1, straight * math.sqrt(count))


@dataclass(frozen=True, slots=True)
class LinearForms:
    """`hold = sign * (score - keep * reference - base)`; `slack` the same with the lenient numbers.

    `hold` lies in `-floor..most`, `slack` in `-least..` (all three 0 or more, infinity where a range has no end).
    `relative` forms read a reference score beside every score and say nothing while all references are 0.
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
        """The larger end of what `hold` can be that is finite; 1 when neither is."""
        return max((bound for bound in (self.most, self.floor) if 0.0 < bound < math.inf), default=1.0)

    def evidence(self, alpha: float = 0.05, *, fail_alpha: float | None = None) -> Evidence:
        """Return a new collector for these forms."""
        return Evidence(most=self.most, least=self.least, alpha=alpha, fail_alpha=fail_alpha)


def degradation_forms(
    limit: float, margin: float = 0.10, *, comparison: str = "<=", top_score: float = _TOP_SCORE
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
    limit: float,
    comparison: str,
    *,
    margin: float,
    low: float = -math.inf,
    high: float = math.inf,
) -> LinearForms:
    """Return the forms of a mean over routes against `limit`, for values in `low..high`.

    Such are DS (0..100), SR (0..1), comfort and efficiency.

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
    return LinearForms(sign, 0.0, limit, 0.0, limit - sign * give, above, below, max(0.0, below - give), False)


def _require(comparison: str, margin: float) -> None:
    if comparison not in ("<=", ">="):
        raise ValueError(f"{comparison!r} compares nothing. Expected '<=' or '>='.")
    if not 0.0 < margin < math.inf:
        raise ValueError(f"the margin is {margin!r}, expected a number above 0 such as 0.10.")


def fail_p_value(
    forms: LinearForms, scores: Sequence[float], references: Sequence[float] = (), *, ended: bool = True
) -> float:
    """Return the p-value against "the requirement holds", of the routes read so far in order; `alpha` or less: fail.

    The fail side of the evidence verdict as a number: the largest e-value weighs a fifth, the last look the rest. With
    `ended` False the last look is still to come and only betting counts. Holm's procedure needs smaller values than one
    verdict does, so read all routes for it instead of stopping at the verdict.
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
        p_value = min(p_value, mean_below_zero_p(holds, scale=forms.scale) / (1.0 - EARLY_SHARE))
    return min(1.0, p_value)
