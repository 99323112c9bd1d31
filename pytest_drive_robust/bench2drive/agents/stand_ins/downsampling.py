"""Stands in for `leaderboard.utils.route_manipulation`: which points of the dense route an agent keeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

__all__ = ["downsample_route"]

_LANE_CHANGES = (5, 6)


def downsample_route(route: Sequence[tuple[Any, Any]], sample_factor: float) -> list[int]:
    """Return the indices of the points to keep of `[(transform, RoadOption), ...]`.

    Those are all points of lane changes, the points where the command is another one than before, one whenever more
    than `sample_factor` metres went by since the last one, and the last point.
    """
    kept: list[int] = []
    since_m = 0.0
    for number, (transform, command) in enumerate(route):
        if number > 0:
            since_m += transform.location.distance(route[number - 1][0].location)
        before = route[number - 1][1].value if number > 0 else None
        changing = command.value in _LANE_CHANGES
        changed = before != command.value and before not in _LANE_CHANGES
        if changing or changed or since_m > sample_factor or number == len(route) - 1:
            kept.append(number)
            since_m = 0.0
    return kept
