"""Estimates before the drive what a number of routes can show, by one formula: SE(RD) = noise / sqrt(routes).

`noise` is k = sd(D) / mean(clean): 0.25 to 0.35 for an agent that drives well, 0.35 to 0.5 for others. For a plain mean
(DS, SR) the same formulas hold with the standard deviation of the metric over routes as noise and its unit as margin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from pytest_drive_robust.stats.evidence import BETS, EARLY_SHARE, FEWEST_FOR_T
from pytest_drive_robust.stats.quantiles import normal_quantile

USUAL_NOISE = 0.45
"""The noise of RD for an unknown agent."""

_POWER = 0.90
"""The probability with which a gate catches a violation of the size that `resolution` returns."""
_RANGE_PER_MEAN = 2.0
"""The top score as a multiple of the mean clean score: 2 for an agent at half of the top score."""
_COARSE = 0.30
_WANTED = 100
_ACCEPTED = 50


@dataclass(frozen=True, slots=True)
class Advice:
    """Advice on whether the planned routes can carry a margin; `text` is empty when `level` is `"fine"`."""

    level: Literal["fine", "warn", "refuse"]
    text: str


def told_apart(routes: int, noise: float = USUAL_NOISE, *, alpha: float = 0.05, scale: float = 1.0) -> float:
    """Return how far apart two values must be for `routes` pairs to tell them apart by their spread.

    Fewer than 20 routes are judged by betting alone: even if all routes lose equally, the gamblers must multiply their
    wealth in few steps, each a share of the range of a score. `scale` is that range in the unit of the metric (1 for RD
    and SR, 100 for DS). A result beyond `scale` means that no two values are ever told apart.

    Raises `ValueError` for no route.
    """
    if routes < 1:
        raise ValueError(f"{routes} routes can show nothing. Expected 1 or more.")
    sampling = _distance(alpha) * noise / math.sqrt(routes)
    if routes >= FEWEST_FOR_T:
        return sampling
    growth = math.pow(len(BETS) / (EARLY_SHARE * alpha), 1.0 / routes)
    return max(sampling, scale * _RANGE_PER_MEAN * (growth - 1.0) / max(BETS))


def resolution(routes: int, noise: float = USUAL_NOISE, *, alpha: float = 0.05, scale: float = 1.0) -> float:
    """Return the smallest violation that a gate on `routes` pairs catches with a probability of 90 %.

    The result is that of `told_apart`, and larger for 20 to some 45 routes: a fail must stand against the chance that
    the routes which would make up for the others were not drawn (`evidence.unseen_p`).

    >>> round(resolution(50), 2)
    0.19

    Raises `ValueError` for no route.
    """
    told = told_apart(routes, noise, alpha=alpha, scale=scale)
    if routes < FEWEST_FOR_T:
        return told
    error, step = noise / math.sqrt(routes), _RANGE_PER_MEAN * scale / routes
    unseen = (number / 8.0 for number in range(math.ceil(-8.0 * math.log(alpha))))  # none of so many: exp(-unseen)
    needed = max(number * step + error * normal_quantile(1.0 - alpha * math.exp(number)) for number in unseen)
    return max(told, needed + error * normal_quantile(_POWER))


def routes_needed(margin: float, noise: float = USUAL_NOISE, *, alpha: float = 0.05, scale: float = 1.0) -> int:
    """Return how many routes, 20 or more, catch a violation of `margin` with a probability of 90 %.

    >>> routes_needed(0.10)
    187

    Raises `ValueError` for a margin of 0 or less.
    """
    if not margin > 0.0:
        raise ValueError(f"the margin is {margin!r}, expected a number above 0.")
    wanted = _distance(alpha) * noise / margin
    routes = max(FEWEST_FOR_T, math.ceil(wanted**2))
    while resolution(routes, noise, alpha=alpha, scale=scale) > margin:
        routes += 1
    return routes


def advise(
    routes: int, margin: float, noise: float = USUAL_NOISE, *, what: str = "RD", scale: float = 1.0, alpha: float = 0.05
) -> Advice:
    """Return the advice, shown at collection, on a gate with `routes` routes and this margin.

    Refuses fewer than 20 routes, unless the margin is 0.30 or more of `scale` (the metric's range: 1 for RD and SR, 100
    for DS). Warns of a margin finer than the resolution and of fewer than 50 routes.
    """
    finest = resolution(routes, noise, alpha=alpha, scale=scale)
    needed = routes_needed(margin, noise, alpha=alpha, scale=scale)
    shown = f"{routes} {'route' if routes == 1 else 'routes'}"
    wish = f"the margin of {margin:.2f} takes about {math.ceil(needed / 10) * 10} routes"
    if routes < FEWEST_FOR_T and margin < _COARSE * scale:
        least = f"Give {FEWEST_FOR_T} routes or more, or a margin of {_COARSE * scale:g} or more"
        return Advice("refuse", f"{shown} cannot carry a verdict on {what}; {wish}. {least}.")
    if finest > margin:
        missed = f"where {what} misses it by {finest:.2f} or more ({_POWER:.0%} of the time)"
        text = f"{shown} show that a limit is broken {missed if finest < scale else 'in no case'}"
        return Advice("warn", f"{text}; {wish}. Give more routes or a wider margin, or expect inconclusive verdicts")
    if routes < _ACCEPTED:
        text = (
            f"{shown} are few: scores of so few routes can be far from normal. {_ACCEPTED} are better, {_WANTED} good"
        )
        return Advice("warn", text)
    return Advice("fine", "")


def _distance(alpha: float) -> float:
    """Return the distance from the limit, in standard errors, that the last look finds with a chance of `_POWER`."""
    return normal_quantile(1.0 - (1.0 - EARLY_SHARE) * alpha) + normal_quantile(_POWER)
