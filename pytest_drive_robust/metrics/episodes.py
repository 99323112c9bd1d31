"""Helpers of every metric: refuse episodes that cannot be scored, average the seeds of a route, then the routes.

The route is the unit of analysis. An episode without data (None) is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError, UnknownNameError

MODES = ("bench2drive", "fixed")
"""`bench2drive` repeats the official tools bug by bug, `fixed` repairs them; each metric says where they differ."""


def require_mode(mode: str) -> None:
    """Raise `UnknownNameError` when `mode` is not one of `MODES`."""
    if mode not in MODES:
        raise UnknownNameError.of("metric mode", mode, MODES)


def require_scorable(results: Sequence[EpisodeResult]) -> None:
    """Raise `ComparisonError` when there is no episode at all or one ended with `infra_error`."""
    if not results:
        raise ComparisonError("there is no episode to score. Expected at least one; a score of nothing is not 0.")
    broken = [result for result in results if result.outcome is Outcome.INFRA_ERROR]
    if broken:
        first = broken[0]
        raise ComparisonError(
            f"{len(broken)} of {len(results)} episodes ended with infra_error and are never scored, "
            f"first: {first.episode}: {first.end_detail}. Drive them again."
        )


def route_and_seed(result: EpisodeResult) -> tuple[str, int]:
    """Return (route id, seed), by which an episode is paired with its clean twin."""
    return result.episode.route_id, result.episode.seed


def values_by_route(
    results: Sequence[EpisodeResult], value_of: Callable[[EpisodeResult], float | None]
) -> dict[str, float]:
    """Return the mean over seeds of `value_of` for each route with data, in the order of the routes' first episodes."""
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
