"""Draw lines along lanes of a town with lane changes, for the routes of the generator."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, project
from pytest_drive_robust.simulators.embedded.map import CompiledTown

_CHANGE_S = 2.4
_LEAST_CHANGE_M = 20.0
_WIDEST_M = 5.0
"""Greatest distance between the centres of lanes that lie side by side."""


def change_length_m(speed_mps: float) -> float:
    """Return the metres that a lane change takes at a speed limit: 2.4 s (at most 3 m/s2 sideways), at least 20 m."""
    return max(_LEAST_CHANGE_M, _CHANGE_S * speed_mps)


def weave(town: CompiledTown, chains: list[str], *, start_m: float, changes_m: list[float], length_m: float) -> Floats:
    """Return a line (n, 2), a point every metre, from `start_m` along the first chain.

    After `changes_m[k]` metres the line begins to move over to chain k + 1, along a cosine. Raises `RouteError` where
    the two do not lie side by side, or a chain is too short.
    """
    lines = [town.chain(chain) for chain in chains]
    limit = max(town.lane_map.lanes[k].speed_limit_mps for chain in chains for k in town.lanes_of(chain))
    over = change_length_m(limit)
    points: list[tuple[float, float]] = []
    at, driven = start_m, 0.0
    for k, begins in enumerate(changes_m):
        if begins < driven:
            raise RouteError(f"town {town.lane_map.name}: lane change {k + 1} begins before the one before it ends")
        points += [place(lines[k], at + step)[:2] for step in np.arange(0.0, begins - driven)]
        points += _move_over(lines[k], lines[k + 1], at + begins - driven, over, chains[k : k + 2])
        at = _beside(lines[k + 1], place(lines[k], at + begins - driven + over)[:2], chains[k : k + 2])
        driven = begins + over
    left = length_m - driven
    if left < 0.0 or at + left > arc_lengths(lines[-1])[-1]:
        raise RouteError(f"town {town.lane_map.name}: chain {chains[-1]!r} does not fit a route of {length_m:.0f} m")
    points += [place(lines[-1], at + step)[:2] for step in (*np.arange(0.0, left), left)]
    return np.array(points)


def _move_over(
    line: Floats, other: Floats, from_m: float, over_m: float, names: list[str]
) -> list[tuple[float, float]]:
    if from_m + over_m > arc_lengths(line)[-1]:
        raise RouteError(f"lane {names[0]!r} ends before the route has changed to {names[1]!r}")
    moved = []
    for step in np.arange(0.0, over_m):
        here = np.array(place(line, from_m + step)[:2])
        there = np.array(place(other, _beside(other, here, names))[:2])
        share = 0.5 - 0.5 * scalars.cos(math.pi * step / over_m)
        x, y = here + share * (there - here)
        moved.append((float(x), float(y)))
    return moved


def _beside(line: Floats, point: tuple[float, float] | Floats, names: list[str]) -> float:
    """Return the metres along `line` level with `point`. Raises `RouteError` when `point` is not beside the line."""
    s, aside = project(line, float(point[0]), float(point[1]))
    if not 0.0 <= s <= arc_lengths(line)[-1] or abs(aside) > _WIDEST_M:
        raise RouteError(f"lanes {names[0]!r} and {names[1]!r} do not lie side by side where the route changes")
    return s
