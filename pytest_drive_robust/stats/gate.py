"""Three verdicts from evidence: does the requirement hold on routes like these?

One number per route, read in planned order. `hold` has a mean of 0 or more exactly when the requirement holds;
`slack` has a mean above 0 exactly when it is missed by less than the margin. For RD <= limit these are
`P - (1 - limit) * C` and `P - (1 - limit - margin) * C`: linear in the scores, so nothing is divided.

After every route a betting e-process may decide (alpha / 5; valid however often one looks: Waudby-Smith and Ramdas
2024, "Estimating means of bounded random variables by betting"). When the routes run out there is one look with Hall's
skewness-corrected t test (alpha * 4 / 5; Hall 1992, "On the removal of skewness by transformation"), with one
pessimistic pseudo route on the pass side, because rare failures that were not seen yet would make it too sure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from math import fsum
from typing import Literal, NamedTuple

from pytest_drive_robust.errors import ComparisonError

__all__ = ["Decision", "Evidence", "GateVerdict", "Wealth", "gate"]

Decision = Literal["pass", "fail", "inconclusive"]

_EARLY_SHARE = 0.2
_FEWEST_FOR_T = 20  # fewer two-humped scores have no usable t statistic
_TOP_SCORE = 100.0


class GateVerdict(NamedTuple):
    """The verdict and how many pairs it took."""

    verdict: Decision
    pairs: int


class Wealth:
    """What three gamblers own on average who bet on "the mean of x is above 0", for x >= -1 whose mean is 0 at most.

    `value` is the e-value of the evidence so far: 100 is reached with a chance of 1 in 100 at most.
    """

    __slots__ = ("_owned", "value")

    def __init__(self) -> None:
        self._owned = (1.0, 1.0, 1.0)
        self.value = 1.0

    def bet(self, x: float) -> float:
        """The wealth after one more value. Raises `ComparisonError` below -1."""
        if not x >= -1.0:
            if not x > -1.0 - 1e-9:
                raise ComparisonError(f"a value of {x!r} lies outside the range that its scores can have.")
            x = -1.0
        low, middle, high = self._owned
        low, middle, high = low * (1.0 + 0.2 * x), middle * (1.0 + 0.5 * x), high * (1.0 + 0.9 * x)
        self._owned = low, middle, high
        self.value = (low + middle + high) / 3.0
        return self.value


class Evidence:
    """Collects routes in planned order until they decide.

    `most` is the largest value that `hold` can take, `least` the smallest one of `slack`, as a positive number; both
    above 0. `alpha` bounds the chance of a wrong fail, and that of a wrong pass. `against` and `within` hold the
    e-values of the two sides, `needed` is what decides.
    """

    def __init__(self, *, most: float, least: float, alpha: float = 0.05) -> None:
        if not (most > 0.0 and least > 0.0):
            raise ValueError(f"the ranges are {most!r} and {least!r}, expected two numbers above 0.")
        if not 0.0 < alpha < 0.5:
            raise ValueError(f"alpha is {alpha!r}, expected a number between 0 and 0.5 such as 0.05.")
        self._most, self._least, self._alpha = most, least, alpha
        self.needed = 1.0 / (alpha * _EARLY_SHARE)
        self.against, self.within = Wealth(), Wealth()
        self._holds: list[float] = []
        self._slacks: list[float] = []
        self.decision: Decision | None = None

    @property
    def routes(self) -> int:
        """How many routes were read."""
        return len(self._holds)

    def read(self, hold: float, slack: float) -> Decision | None:
        """One more route; the verdict as soon as there is one. Later routes change nothing any more."""
        if self.decision is not None:
            return self.decision
        self._holds.append(hold)
        self._slacks.append(slack)
        against, within = self.against.bet(-hold / self._most), self.within.bet(slack / self._least)
        if against >= self.needed:
            self.decision = "fail"
        elif within >= self.needed:
            self.decision = "pass"
        return self.decision

    def close(self) -> Decision:
        """The last look, once there are no more routes."""
        if self.decision is None:
            self.decision = self._last_look()
        return self.decision

    def _last_look(self) -> Decision:
        alpha = self._alpha * (1.0 - _EARLY_SHARE)
        if self.routes >= _FEWEST_FOR_T:
            if mean_below_zero_p(self._holds) <= alpha:
                return "fail"
            if 1.0 - mean_below_zero_p([*self._slacks, -self._least]) <= alpha:
                return "pass"
        return "inconclusive"


def mean_below_zero_p(values: Sequence[float]) -> float:
    """The p-value against "the mean is 0 or more" by Hall's transformed t statistic; small: the mean is below 0."""
    from scipy.special import stdtr

    count, mean = len(values), fsum(values) / len(values)
    spread = math.sqrt(fsum((value - mean) ** 2 for value in values) / count)
    share = mean / max(spread * math.sqrt(count / (count - 1)), 1e-9 * max(abs(mean), 1e-9))
    share = max(-1e6, min(1e6, share))
    skew = fsum((value - mean) ** 3 for value in values) / count / max(spread, 1e-6) ** 3
    straight = share + skew * share**2 / 3.0 + skew**2 * share**3 / 27.0 + skew / (6.0 * count)
    return float(stdtr(count - 1, straight * math.sqrt(count)))


def gate(
    clean: Iterable[float], perturbed: Iterable[float], threshold: float, margin: float = 0.10, alpha: float = 0.05
) -> GateVerdict:
    """Is RD = 1 - mean(perturbed) / mean(clean) at most `threshold`, judged on driving scores 0..100 per route?

    `clean` and `perturbed` give one score per route each, in planned order; average the seeds of a route first.
    "fail": RD exceeds the threshold; "pass": it stays below threshold + margin; each wrong at most `alpha` of the time.
    Fewer than 20 routes are judged by betting alone. A clean score of 0 throughout is inconclusive.

    >>> gate([90.0] * 30, [88.0] * 30, threshold=0.30)
    GateVerdict(verdict='pass', pairs=14)
    >>> gate([90.0] * 30, [20.0] * 30, threshold=0.30).verdict
    'fail'

    Raises `ComparisonError` for scores outside 0..100, lists of different lengths or no pair, `ValueError` for a
    threshold, margin or alpha that leaves nothing to decide.
    """
    if not (math.isfinite(threshold) and margin > 0.0 and threshold < 1.0):
        raise ValueError(f"expected a threshold below 1 and a margin above 0, not {threshold!r} and {margin!r}.")
    keep = 1.0 - threshold
    allow = max(keep - margin, 0.5 * keep)  # a margin that reaches RD 1 would pass everything
    evidence = Evidence(most=_TOP_SCORE, least=_TOP_SCORE * allow, alpha=alpha)
    anything = False
    for before, after in _pairs(clean, perturbed):
        anything = anything or before > 0.0
        if evidence.read(after - keep * before, after - allow * before) is not None:
            break
    if evidence.routes == 0:
        raise ComparisonError("there is no pair to judge. Expected one clean and one perturbed score per route.")
    return GateVerdict(evidence.close() if anything else "inconclusive", evidence.routes)


def _pairs(clean: Iterable[float], perturbed: Iterable[float]) -> Iterable[tuple[float, float]]:
    try:
        for pair in zip(clean, perturbed, strict=True):
            for score in pair:
                if not 0.0 <= score <= _TOP_SCORE:
                    raise ComparisonError(f"a driving score is {score!r}, expected a number in 0..100.")
            yield pair
    except ValueError:
        raise ComparisonError("clean and perturbed scores do not pair. Expected one of each per route.") from None
