"""Project bodies on a line: compiled searches among the line's rows, about one row a metre."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning import columns as box
from pytest_drive_robust.arithmetic.compiled import cos, sin
from pytest_drive_robust.jit.arrays import Floats, Floats2, Floats3, Ints, Ints1
from pytest_drive_robust.jit.kernels import entry, inner

__all__ = ["crossed_junctions", "leaders", "nearest_ahead", "nearest_row", "project", "project_all"]

_AHEAD_M = 70
_SAME_LANE_M = 1.7


@inner
def nearest_row(line: Floats, first: int, last: int, x: float, y: float) -> int:
    """Return the row whose place is nearest, among the rows `first` to before `last` of a line (n, >=2)."""
    first, last = max(0, min(first, len(line) - 1)), max(1, min(last, len(line)))
    best, at = 1e18, first
    for k in range(first, last):
        dx, dy = x - line[k, 0], y - line[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
    return at


@entry
def project(line: Floats2, first: int, last: int, x: float, y: float) -> tuple[float, float]:
    """Return (row, metres to the right) of a place on a line (n, >=3), at the nearest row as `nearest_row`."""
    at = nearest_row(line, first, last, x, y)
    c, s = cos(line[at, 2]), sin(line[at, 2])
    dx, dy = x - line[at, 0], y - line[at, 1]
    return at + dx * c + dy * s, dy * c - dx * s


@entry
def project_all(line: Floats2, first: int, last: int, actors: Floats2) -> Floats:
    """Apply `project` to every row of `actors` (x and y come first): (k, 2)."""
    found = np.empty((len(actors), 2))
    for i in range(len(actors)):
        found[i, 0], found[i, 1] = project(line, first, last, actors[i, box.X], actors[i, box.Y])
    return found


@entry
def nearest_ahead(
    route: Floats2, progress: int, ego: tuple[float, float, float, float], actors: Floats2
) -> tuple[float, float]:
    """Return (bumper-to-bumper metres, speed along the route) of the first body in the ego's corridor, or (inf, 0).

    `ego` is x, y, length, width; `actors` (k, >=6) holds x, y, yaw, speed, length, width.
    """
    x, y, length, width = ego
    s, _ = project(route, progress - 5, progress + 10, x, y)
    gap, speed = math.inf, 0.0
    for i in range(len(actors)):
        other = actors[i]
        if abs(other[box.X] - x) > _AHEAD_M or abs(other[box.Y] - y) > _AHEAD_M:
            continue
        at, right = project(route, progress - 5, progress + _AHEAD_M, other[box.X], other[box.Y])
        turn = route[int(min(max(at, 0.0), len(route) - 1.0)), 2] - other[box.YAW]
        co, si = abs(cos(turn)), abs(sin(turn))
        found = at - s - 0.5 * (length + co * other[box.LENGTH] + si * other[box.WIDTH])
        beside = 0.5 * (width + co * other[box.WIDTH] + si * other[box.LENGTH])
        if at > s and abs(right) < beside and found < gap:
            gap, speed = found, max(0.0, other[box.SPEED] * cos(turn))
    return gap, speed


@entry
def leaders(path: Floats2, s0: float, actors: Floats2) -> Ints:
    """Return (k,) 1 for each actor ahead in the ego's corridor that drives the same way and may brake at any moment.

    `path` (n, 5) and `actors` (k, 9) hold cosine and sine of yaw, as `lateral.path_of` and `Traffic.boxes` do.
    """
    found = np.zeros(len(actors), dtype=np.int64)
    row = int(max(s0, 0.0))
    for i in range(len(actors)):
        k = nearest_row(path, row - 5, row + 80, actors[i, box.X], actors[i, box.Y])
        dx, dy = actors[i, box.X] - path[k, 0], actors[i, box.Y] - path[k, 1]
        ahead, right = k + dx * path[k, 3] + dy * path[k, 4] - s0, dy * path[k, 3] - dx * path[k, 4]
        same_way = path[k, 3] * actors[i, box.COS] + path[k, 4] * actors[i, box.SIN] > 0.8
        if same_way and ahead > 1.0 and abs(right) < _SAME_LANE_M:
            found[i] = 1
    return found


@entry
def crossed_junctions(path: Floats2, junctions: Floats2, forecast: Floats3, leads: Ints1, steps: int) -> Ints:
    """Return 1 for every junction (first row, last row of `path`) that another actor is about to drive through.

    `forecast` (k, >= steps, 6) are the tracks of all actors; actors with 1 in `leads` (k,) do not count.
    """
    found = np.zeros(len(junctions), dtype=np.int64)
    for b in range(len(junctions)):
        middle = int(0.5 * (junctions[b, 0] + junctions[b, 1]))
        reach = 0.5 * (junctions[b, 1] - junctions[b, 0]) + 3.0
        for i in range(len(forecast)):
            if leads[i] == 1 or forecast[i, 0, 3] <= 0.5:
                continue
            for step in range(steps):
                dx, dy = forecast[i, step, 0] - path[middle, 0], forecast[i, step, 1] - path[middle, 1]
                if dx * dx + dy * dy < reach * reach:
                    found[b] = 1
                    break
    return found
