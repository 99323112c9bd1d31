"""Figures over routes, each with its 95 % interval; the route is the unit of analysis and every comparison is paired.

RD and the means have the package's own intervals (`pytest_drive_robust.stats.intervals`). What compares several RDs,
also of different agents, is a smooth function of means over the same routes: its interval is the jackknife's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from _paper.published import CLEAN, SETTINGS
from _paper.results import Results
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.stats.intervals import jackknife_interval, mean_interval, ratio_interval, share_interval

__all__ = [
    "IntervalEstimate", "Means", "degradation", "driving_score", "ds_means", "efficiency", "efficiency_means", "gap",
    "mean_degradation", "rd_means", "success_rate",
]  # fmt: skip

Means = NDArray[np.float64]
"""A mean over all routes, then over all but the first, all but the second ...: (1 + routes,)."""


@dataclass(frozen=True, slots=True)
class IntervalEstimate:
    """A value and its two-sided 95 % interval."""

    value: float
    low: float
    high: float


def driving_score(results: Results, agent: str, setting: str) -> IntervalEstimate | None:
    """Return the mean DS, 0..100, with Student's interval; None where it was not driven, here and below."""
    scores = results.scores(agent, setting)
    if scores is None:
        return None
    return IntervalEstimate(mean(scores.driving_score), *mean_interval(scores.driving_score, bounds=(0.0, 100.0)))


def success_rate(results: Results, agent: str, setting: str) -> IntervalEstimate | None:
    """Return the success rate 0..1 with Wilson's interval."""
    scores = results.scores(agent, setting)
    return None if scores is None else IntervalEstimate(mean(scores.success), *share_interval(scores.success))


def efficiency(results: Results, agent: str, setting: str) -> float | None:
    """Return the mean over the routes that have data, percent of the traffic's speed."""
    scores = results.scores(agent, setting)
    known = [] if scores is None else [value for value in scores.efficiency if value is not None]
    return mean(known) if known else None


def degradation(results: Results, agent: str, setting: str) -> IntervalEstimate | None:
    """Return RD = 1 - DS / DS clean with Fieller's interval."""
    clean, perturbed = results.scores(agent, CLEAN), results.scores(agent, setting)
    if clean is None or perturbed is None:
        return None
    return _fieller(clean.driving_score, perturbed.driving_score)


def mean_degradation(results: Results, agent: str) -> IntervalEstimate | None:
    """Return RD of the mean DS over the eleven settings, the mean of their RDs, with Fieller's interval."""
    clean = results.scores(agent, CLEAN)
    rows = [scores.driving_score for setting in SETTINGS if (scores := results.scores(agent, setting)) is not None]
    if clean is None or len(rows) < len(SETTINGS):
        return None
    return _fieller(clean.driving_score, [mean(of_route) for of_route in zip(*rows, strict=True)])


def _fieller(clean: Sequence[float], perturbed: Sequence[float]) -> IntervalEstimate:
    return IntervalEstimate(1.0 - mean(perturbed) / mean(clean), *ratio_interval(clean, perturbed))


def ds_means(results: Results, agent: str, setting: str) -> Means | None:
    """Return the means of the driving score."""
    scores = results.scores(agent, setting)
    return None if scores is None else _means(scores.driving_score)


def rd_means(results: Results, agent: str, settings: Sequence[str]) -> Means | None:
    """Return the means of RD over `settings`."""
    clean = ds_means(results, agent, CLEAN)
    rows = [row for setting in settings if (row := ds_means(results, agent, setting)) is not None]
    if clean is None or len(rows) < len(settings):
        return None
    degradations: Means = 1.0 - np.mean(rows, axis=0) / clean
    return degradations


def efficiency_means(results: Results, agent: str, setting: str) -> tuple[Means, Means] | None:
    """Return the efficiency clean and under a setting, over the routes that have data in both."""
    clean, perturbed = results.scores(agent, CLEAN), results.scores(agent, setting)
    if clean is None or perturbed is None:
        return None
    pairs = [
        (before, after)
        for before, after in zip(clean.efficiency, perturbed.efficiency, strict=True)
        if before is not None and after is not None
    ]
    if len(pairs) < 2:
        return None
    return _means([before for before, _ in pairs]), _means([after for _, after in pairs])


def gap(more: Means | None, less: Means | None, confidence: float = 0.95) -> IntervalEstimate | None:
    """Return how much larger the first is, with the jackknife's interval; None when either was not driven."""
    if more is None or less is None:
        return None
    value, *without_route = (float(difference) for difference in more - less)
    return IntervalEstimate(value, *jackknife_interval(value, without_route, confidence))


def _means(values: Sequence[float]) -> Means:
    column = np.array(values, dtype=np.float64)
    return np.concatenate(([column.mean()], (column.sum() - column) / (len(column) - 1)))
