"""Figures over routes with 95 % intervals; the route is the unit of analysis, and every comparison is paired.

A figure belongs to one row of the table, or is the plain mean of several rows, as in the paper; it is None when a row
was not driven. RD and the means have the package's own intervals (`pytest_drive_robust.stats.intervals`). A comparison
of several RDs, also of different agents or with different clean drives, is a smooth function of means over common
routes and has the jackknife's interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from _paper.readings import Drives
from _paper.results import Scores
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.stats.intervals import jackknife_interval, mean_interval, ratio_interval, share_interval

__all__ = [
    "IntervalEstimate", "Means", "comfort", "degradation", "driving_score", "ds_means", "efficiency",
    "efficiency_means", "gap", "rd_means", "standard_error", "success_rate",
]  # fmt: skip

Means = NDArray[np.float64]
"""Means (1 + routes,): over all routes, then over all routes but the first, all but the second, ..."""


@dataclass(frozen=True, slots=True)
class IntervalEstimate:
    """A value and its two-sided 95 % interval."""

    value: float
    low: float
    high: float


def driving_score(drives: Drives, agent: str, rows: Sequence[str]) -> IntervalEstimate | None:
    """Return the mean DS, 0..100, with Student's interval."""
    driven = _all(drives, agent, rows)
    if driven is None:
        return None
    scores = _by_route([scores.driving_score for scores in driven])
    return IntervalEstimate(mean(scores), *mean_interval(scores, bounds=(0.0, 100.0)))


def success_rate(drives: Drives, agent: str, rows: Sequence[str]) -> IntervalEstimate | None:
    """Return the success rate 0..1 with Wilson's interval, which is wider than needed for several rows."""
    driven = _all(drives, agent, rows)
    if driven is None:
        return None
    shares = _by_route([scores.success for scores in driven])
    return IntervalEstimate(mean(shares), *share_interval(shares))


def efficiency(drives: Drives, agent: str, rows: Sequence[str]) -> float | None:
    """Return the mean over the routes that have data, percent of the traffic's speed."""
    driven = _all(drives, agent, rows)
    known = [[value for value in scores.efficiency if value is not None] for scores in driven or ()]
    return mean([mean(values) for values in known]) if known and all(known) else None


def comfort(drives: Drives, agent: str, rows: Sequence[str]) -> float | None:
    """Return the mean over the routes that have data, percent of the segments."""
    known = [scores.comfort for scores in _all(drives, agent, rows) or ()]
    values = [value for value in known if value is not None]
    return mean(values) if values and len(values) == len(known) else None


def degradation(drives: Drives, agent: str, rows: Sequence[str]) -> IntervalEstimate | None:
    """Return RD = 1 - DS / DS clean with Fieller's interval; the jackknife's for rows with different clean drives."""
    pairs = [drives.pair(agent, row) for row in rows]
    known = [pair for pair in pairs if pair is not None]
    if len(known) < len(pairs):
        return None
    clean = known[0][0].driving_score
    if all(before.driving_score == clean for before, _ in known):
        perturbed = _by_route([after.driving_score for _, after in known])
        return IntervalEstimate(1.0 - mean(perturbed) / mean(clean), *ratio_interval(clean, perturbed))
    value, *without_route = map(float, _rd_means(known))
    return IntervalEstimate(value, *jackknife_interval(value, without_route))


def ds_means(drives: Drives, agent: str, row: str) -> Means | None:
    """Return the means of the driving score."""
    scores = drives.scores(agent, row)
    return None if scores is None else _means(scores.driving_score)


def rd_means(drives: Drives, agent: str, rows: Sequence[str]) -> Means | None:
    """Return the means of RD over `rows`."""
    pairs = [drives.pair(agent, row) for row in rows]
    known = [pair for pair in pairs if pair is not None]
    return _rd_means(known) if len(known) == len(pairs) else None


def efficiency_means(drives: Drives, agent: str, row: str) -> tuple[Means, Means] | None:
    """Return the efficiency clean and in a row, over the routes with data in both with one seed."""
    pair = drives.pair(agent, row)
    if pair is None:
        return None
    of_seeds = [
        zip(before.efficiency, after.efficiency, strict=True)
        for before, after in zip(pair[0].of_seeds, pair[1].of_seeds, strict=True)
    ]
    both = [
        known
        for of_route in zip(*of_seeds, strict=True)
        if (known := [(before, after) for before, after in of_route if before is not None and after is not None])
    ]
    if len(both) < 2:
        return None
    before, after = ([mean([values[side] for values in known]) for known in both] for side in (0, 1))
    return _means(before), _means(after)


def gap(more: Means | None, less: Means | None, confidence: float = 0.95) -> IntervalEstimate | None:
    """Return how much larger the first is, with the jackknife's interval; None when either was not driven."""
    if more is None or less is None:
        return None
    value, *without_route = (float(difference) for difference in more - less)
    return IntervalEstimate(value, *jackknife_interval(value, without_route, confidence))


def standard_error(means: Means) -> float:
    """Return the jackknife's standard error of the estimate `means[0]`."""
    left_out = means[1:]
    return float(np.sqrt((len(left_out) - 1) / len(left_out) * ((left_out - left_out.mean()) ** 2).sum()))


def _all(drives: Drives, agent: str, rows: Sequence[str]) -> list[Scores] | None:
    """Return the scores of all rows, or None when one was not driven."""
    driven = [scores for row in rows if (scores := drives.scores(agent, row)) is not None]
    return driven if len(driven) == len(rows) else None


def _by_route(rows: Sequence[Sequence[float]]) -> list[float]:
    """Return the mean over the rows, one for each route."""
    return [mean(of_route) for of_route in zip(*rows, strict=True)]


def _rd_means(pairs: Sequence[tuple[Scores, Scores]]) -> Means:
    kept = [_means(after.driving_score) / _means(before.driving_score) for before, after in pairs]
    degradations: Means = 1.0 - np.mean(kept, axis=0)
    return degradations


def _means(values: Sequence[float]) -> Means:
    column = np.array(values, dtype=np.float64)
    return np.concatenate(([column.mean()], (column.sum() - column) / (len(column) - 1)))
