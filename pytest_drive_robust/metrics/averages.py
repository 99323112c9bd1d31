"""Means over routes: the seeds of a route are averaged first, so that the route is the unit of analysis.

With as many seeds on every route this is the plain mean over episodes. An episode without data (None) is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["mean", "mean_over_routes", "values_by_route"]


def values_by_route(
    results: Sequence[EpisodeResult], value_of: Callable[[EpisodeResult], float | None]
) -> dict[str, float]:
    """Return the mean over seeds of `value_of`, for each route that has data, in the order of their first episode."""
    collected: dict[str, list[float]] = {}
    for result in results:
        value = value_of(result)
        if value is not None:
            collected.setdefault(result.episode.route_id, []).append(value)
    return {route_id: mean(values) for route_id, values in collected.items()}


def mean_over_routes(
    results: Sequence[EpisodeResult], value_of: Callable[[EpisodeResult], float | None]
) -> float | None:
    """Return the mean over routes of the mean over seeds, or None when no episode has data."""
    by_route = values_by_route(results, value_of)
    return mean(list(by_route.values())) if by_route else None
