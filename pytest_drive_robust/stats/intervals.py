"""Two-sided confidence intervals whose unit of analysis is the route: average the seeds of a route first.

All intervals are closed forms, so equal values give equal intervals. Their confidence is 0.95 where none is asked for.
The intervals by Student's t (`mean_interval`, `ratio_interval`, `jackknife_interval`) cannot estimate a spread from one
route and then return the whole range of the quantity, `bounds`. Student's t reads zero spread as certainty: 24 routes
with a score of 100 give 100..100. The other intervals do not.

An interval for a fixed number of routes is too narrow when reading stopped because the verdict looked clear. Betting
stays valid: by whatever rule the reading stopped, the wealth of a bet against the truth reaches 1 / alpha with a chance
of alpha at most. So the thresholds against which betting has not won contain the truth with a chance of 1 - alpha a
side (`evidence_interval`, `mean_evidence_interval`). The wealth at a threshold grows with the distance to the
threshold, so bisection finds the ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from math import fsum
from typing import Literal

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import BETS, EARLY_SHARE, FEWEST_FOR_T, TOP_SCORE, last_fail_p, last_pass_p
from pytest_drive_robust.stats.quantiles import normal_quantile, student_t_quantile

_EVERYTHING = (-math.inf, math.inf)
_LARGEST_RD = 1.0
_CONFIDENCE = 0.95
_STEPS = 36
_FARTHEST = 1e6


def mean_interval(values: Sequence[float], *, bounds: tuple[float, float] = _EVERYTHING) -> tuple[float, float]:
    """Return Student's t interval of the mean of `values` (one per route), cut to `bounds`.

    Contains the mean of `values`. One value gives `bounds`. Raises `ComparisonError` for no value.
    """
    count = _require_values(values)
    if count == 1:
        return bounds
    centre = fsum(values) / count
    variance = fsum((value - centre) ** 2 for value in values) / (count - 1)
    return _around(centre, _t_quantile(_CONFIDENCE, count - 1) * math.sqrt(variance / count), bounds)


def share_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return Wilson's score interval of a success rate; `values` are 0..1, one per route.

    The interval keeps a width when every route succeeded or failed: 24 of 24 give 0.86..1.00. For routes with several
    seeds, whose values lie between 0 and 1, the interval is wider than needed. Source: Wilson 1927, "Probable
    inference, the law of succession, and statistical inference". Raises `ComparisonError` for no value.
    """
    count = _require_values(values)
    share = fsum(values) / count
    z = normal_quantile(0.5 + _CONFIDENCE / 2.0)
    weight = z * z / count
    centre = (share + weight / 2.0) / (1.0 + weight)
    half = math.sqrt(share * (1.0 - share) * weight + weight * weight / 4.0) / (1.0 + weight)
    return max(0.0, min(share, centre - half)), min(1.0, max(share, centre + half))


def ratio_interval(clean: Sequence[float], perturbed: Sequence[float]) -> tuple[float, float]:
    """Return Fieller's interval of RD = 1 - mean(perturbed) / mean(clean), paired: one value per route, same order.

    The interval holds every threshold that the paired t test on `P - (1 - threshold) * C` does not reject; that
    statistic is linear, so nothing is divided. Contains the RD of the means and never exceeds 1, because scores are not
    negative.

    One route gives (-inf, 1). A clean mean that cannot be told from 0 at this confidence also gives (-inf, 1), because
    the test then rejects thresholds on one side only or none at all. Equal lists give (0, 0) for any number of routes.
    Source: Fieller 1954, "Some problems in interval estimation".

    Raises `ComparisonError` for no route, for lists of different length and for a clean mean of 0.
    """
    count = _require_values(clean)
    if len(perturbed) != count:
        raise ComparisonError(
            f"{count} clean and {len(perturbed)} perturbed values do not pair. Expected one per route."
        )
    clean_mean = fsum(clean) / count
    if clean_mean <= 0.0:
        raise ComparisonError(f"the mean clean score is {clean_mean:g}, so the degradation is undefined.")
    if list(clean) == list(perturbed):
        return 0.0, 0.0
    if count == 1:
        return -math.inf, _LARGEST_RD
    ratio = fsum(perturbed) / count / clean_mean
    rd = 1.0 - ratio
    residuals = [after - ratio * before for before, after in zip(clean, perturbed, strict=True)]
    deviations = [before - clean_mean for before in clean]
    scale = _t_quantile(_CONFIDENCE, count - 1) ** 2 / (count * (count - 1))
    spread = scale * fsum(residual * residual for residual in residuals)
    shared = scale * fsum(residual * deviation for residual, deviation in zip(residuals, deviations, strict=True))
    certainty = clean_mean**2 - scale * fsum(deviation * deviation for deviation in deviations)
    if certainty <= 0.0:
        return -math.inf, _LARGEST_RD
    # Thresholds 1 - ratio - shift where certainty * shift^2 + 2 * shared * shift - spread <= 0; the roots enclose 0.
    half = math.sqrt(shared * shared + certainty * spread)
    smallest, largest = (-shared - half) / certainty, (-shared + half) / certainty
    return rd - largest, min(_LARGEST_RD, rd - smallest)


def jackknife_interval(
    value: float,
    without_route: Sequence[float],
    confidence: float = _CONFIDENCE,
    *,
    bounds: tuple[float, float] = _EVERYTHING,
) -> tuple[float, float]:
    """Return the jackknife t interval of any smooth statistic; of a mean it is `mean_interval`.

    `value` is the statistic over all routes, `without_route` the statistic with one route left out, one per route.
    One route gives `bounds`. Source: Efron and Tibshirani 1993, "An introduction to the bootstrap", chapter 11. Raises
    `ValueError` for a `confidence` outside 0..1.
    """
    count = len(without_route)
    if count < 2:
        return bounds
    centre = fsum(without_route) / count
    variance = (count - 1) / count * fsum((other - centre) ** 2 for other in without_route)
    return _around(value, _t_quantile(confidence, count - 1) * math.sqrt(variance), bounds)


def evidence_interval(
    clean: Sequence[float],
    perturbed: Sequence[float],
    alpha: float = 0.05,
    *,
    ended: bool = False,
    comparison: str = "<=",
) -> tuple[float, float]:
    """Return the interval of RD = 1 - mean(perturbed) / mean(clean) from pairs that may have stopped early.

    `alpha` is for each side. Scores are 0..100, one per route. Contains the RD of the means, ends at 1 at most,
    is wider for a smaller alpha, and does not depend on the order. The lower end may be far below 0 after a few pairs.

    `ended` says that the planned routes ran out, so that the gate took its last look. The ends are then the limits at
    which the gate changes its verdict by `comparison`: for `RD <= limit` a fail has `limit <= low` and a pass
    `high <= limit + margin`; for `RD >= limit` a fail has `high <= limit` and a pass `limit - margin <= low` (early
    verdicts have these relations with either `ended`). Either interval misses the truth at most `alpha` of the time on
    each side. A report sets `ended` by how the run ended, which could double that at worst; in the study of
    `tests/calibration/` the misses stay below alpha.

    Raises `ComparisonError` for lists that do not pair, no pair, and a clean mean of 0.
    """
    if len(clean) != len(perturbed) or not clean:
        raise ComparisonError(f"{len(clean)} clean and {len(perturbed)} perturbed values. Expected one pair or more.")
    total = fsum(clean)
    if not total > 0.0:
        raise ComparisonError("the mean clean score is 0, so the degradation is undefined.")
    pairs = [(before / TOP_SCORE, after / TOP_SCORE) for before, after in zip(clean, perturbed, strict=True)]
    rd = 1.0 - fsum(perturbed) / total

    def too_low(threshold: float) -> bool:
        keep = 1.0 - threshold
        gains = [keep * before - after for before, after in pairs]
        return _rejects(gains, 1.0, alpha, _last_look(ended, is_fail=comparison == "<="))

    def too_high(threshold: float) -> bool:
        keep = 1.0 - threshold
        gains = [after - keep * before for before, after in pairs]
        return _rejects(gains, keep, alpha, _last_look(ended, is_fail=comparison == ">="))

    return _turning_point(rd, -math.inf, too_low), min(1.0, _turning_point(rd, 1.0, too_high))


def mean_evidence_interval(
    values: Sequence[float],
    alpha: float = 0.05,
    *,
    low: float,
    high: float,
    ended: bool = False,
    comparison: str = ">=",
) -> tuple[float, float]:
    """Return the interval of a mean over routes of values in `low..high`: SR (0..1), DS and comfort (0..100).

    `alpha`, `ended` and `comparison` are those of `evidence_interval`. An end of the range may be infinite (efficiency
    has no upper end); that end of the interval is then infinite until the last look.

    Raises `ComparisonError` for no value and for one outside the range.
    """
    if not values or not all(low <= value <= high for value in values):
        raise ComparisonError(f"expected one value or more, all in {low:g}..{high:g}.")
    mean = min(high, max(low, fsum(values) / len(values)))

    def too_low(limit: float) -> bool:
        gains = [value - limit for value in values]
        return _rejects(gains, limit - low, alpha, _last_look(ended, is_fail=comparison == "<="))

    def too_high(limit: float) -> bool:
        gains = [limit - value for value in values]
        return _rejects(gains, high - limit, alpha, _last_look(ended, is_fail=comparison == ">="))

    return _turning_point(mean, low, too_low), _turning_point(mean, high, too_high)


def _around(centre: float, half: float, bounds: tuple[float, float]) -> tuple[float, float]:
    return max(bounds[0], centre - half), min(bounds[1], centre + half)


def _t_quantile(confidence: float, degrees_of_freedom: int) -> float:
    return student_t_quantile(degrees_of_freedom, 0.5 + _require_confidence(confidence) / 2.0)


def _require_confidence(confidence: float) -> float:
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"the confidence is {confidence!r}, expected a number between 0 and 1 such as 0.95.")
    return confidence


def _require_values(values: Sequence[float]) -> int:
    if not values:
        raise ComparisonError("there is no value to compute an interval of. Expected one per route.")
    return len(values)


_LastLook = Literal["fail", "pass"]


def _last_look(ended: bool, *, is_fail: bool) -> _LastLook | None:
    """Return which verdict the last look tests at an end of the interval, or None before the routes ran out."""
    if not ended:
        return None
    return "fail" if is_fail else "pass"


def _rejects(gains: Sequence[float], worst: float, alpha: float, last_look: _LastLook | None) -> bool:
    """Return whether the gains reject "their mean is 0 at most" at `alpha`; no gain is below `-worst`."""
    if not worst > 0.0:
        return any(gain > 0.0 for gain in gains)
    if _wealth(gains, worst) * alpha * (EARLY_SHARE if last_look else 1.0) >= 1.0:
        return True
    if last_look is None or len(gains) < FEWEST_FOR_T:
        return False
    scale = worst if worst < math.inf else max(map(abs, gains))
    if last_look == "fail":
        return last_fail_p([-gain for gain in gains], worst, scale=scale) <= alpha
    return last_pass_p(gains, worst, scale=scale) <= alpha


def _wealth(gains: Sequence[float], worst: float) -> float:
    """Return the final value of `evidence.Wealth` after `gains`; without its steps, because a bisection asks often."""
    shares = [max(-1.0, gain / worst) for gain in gains]
    return fsum(math.prod([1.0 + bet * share for share in shares]) for bet in BETS) / len(BETS)


def _turning_point(inside: float, end: float, rejects: Callable[[float], bool]) -> float:
    """Return where `rejects` changes between `inside`, never rejected, and `end`; return `end` if it never changes."""
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
