"""Computes how the evidence for a verdict grew, route by route, and the routes behind the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.table import METRICS, Metric
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.stats.intervals import evidence_interval, mean_evidence_interval

_MOST_POINTS = 30
"""The most steps to compute: an interval over hundreds of routes takes milliseconds."""


def reading_order(records: RunRecords, judged: Mapping[str, Any]) -> list[str]:
    """Return the ids of the routes behind a verdict, in the order of reading."""
    agent, setting = judged["agent"], judged["setting"]
    routes = records.routes.get(judged["routes_spec"], ())
    if routes:
        order: Sequence[str] = planned_order(
            [route.id for route in routes], [route.scenario.type for route in routes], agent
        )
    else:
        episodes = (item for item in records.results if (item.agent, item.setting) == (agent, setting))
        order = list(dict.fromkeys(episode.route_id for episode in episodes))
    driven = [route_id for route_id in order if records.of_setting(agent, setting, [route_id], judged["seeds"])]
    return driven[: judged["routes"]] if judged["routes"] else driven


def growth(records: RunRecords, judged: Mapping[str, Any], order: Sequence[str]) -> list[list[float | None]]:
    """Return [routes read, value, low, high] for a growing number of routes; the bounds are None unless by evidence.

    A route without data is read, too, and changes no value. Empty when the metric has no value by route, or the
    episodes cannot be scored.
    """
    metric = METRICS.get(judged["metric"])
    if metric is None or not order:
        return []
    try:
        scores = _by_route(records, judged, metric, order)
    except (ComparisonError, ValueError):  # for example comfort without a stored trace
        return []
    alpha = records.alpha if judged["rule"] == "evidence" else None
    return [[count, *_step(metric, scores[:count], judged, alpha)] for count in _counts(len(scores))]


def _by_route(
    records: RunRecords, judged: Mapping[str, Any], metric: Metric, order: Sequence[str]
) -> list[tuple[float, float] | None]:
    """Return value and reference of each route, None for a route without data."""
    agent, setting, seeds = judged["agent"], judged["setting"], judged["seeds"]
    if metric.needs_clean:
        results = records.of_setting(agent, setting, order, seeds)
        clean = records.of_setting(agent, records.baseline(setting), order, seeds)
        return list(zip(*metric.by_route(results, clean=clean, mode=records.mode), strict=True))
    of_routes = (records.of_setting(agent, setting, [route_id], seeds) for route_id in order)
    return [metric.of_route(results, mode=records.mode) for results in of_routes]


def _step(
    metric: Metric,
    scores: Sequence[tuple[float, float] | None],
    judged: Mapping[str, Any],
    alpha: float | None,
) -> list[float | None]:
    ended, comparison = len(scores) >= judged["planned"], judged["comparison"]
    known = [found for found in scores if found is not None]
    if not known:
        return [None, None, None]
    values, references = ([found[place] for found in known] for place in (0, 1))
    mean = sum(values) / len(values)
    bounds: tuple[float | None, float | None] = (None, None)
    if not metric.needs_clean:
        if alpha is not None:
            bounds = mean_evidence_interval(
                values, alpha, low=metric.low, high=metric.high, ended=ended, comparison=comparison
            )
        return [mean, *map(bound, bounds)]
    reference = sum(references) / len(references)
    if reference <= 0.0:
        return [None, None, None]
    if alpha is not None:
        bounds = evidence_interval(references, values, alpha, ended=ended, comparison=comparison)
    return [1.0 - mean / reference, *map(bound, bounds)]


def bound(value: float | None) -> float | None:
    """Return the end of an interval, or None when the end is infinite, huge or missing."""
    return value if value is not None and abs(value) < 1e9 else None


def _counts(length: int) -> list[int]:
    """Return 1, 2, 3, ... up to `length`, with gaps if there are more than `_MOST_POINTS`."""
    if length <= _MOST_POINTS:
        return list(range(1, length + 1))
    step = (length - 1) / (_MOST_POINTS - 1)
    return sorted({1 + round(step * place) for place in range(_MOST_POINTS)})
