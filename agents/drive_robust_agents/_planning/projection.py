"""Where things are along a line: compiled searches among its rows, about one a metre."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.jit import entry

__all__ = ["crossed_boxes", "leaders", "nearest_ahead", "project", "project_all"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

X, Y, YAW, SPEED, LENGTH, WIDTH = range(6)
"""Columns of the actors that are searched for."""
_AHEAD_M = 70
_SAME_LANE_M = 1.7


@entry
def project(line: Floats, first: int, last: int, x: float, y: float) -> tuple[float, float]:
    """Return (row, metres to the right) of the nearest place among the rows `first`..`last` of a line (n, >=3)."""
    first, last = max(0, min(first, len(line) - 1)), max(1, min(last, len(line)))
    best, at = 1e18, first
    for k in range(first, last):
        dx, dy = x - line[k, 0], y - line[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
    yaw = line[at, 2]
    dx, dy = x - line[at, 0], y - line[at, 1]
    return at + dx * math.cos(yaw) + dy * math.sin(yaw), -dx * math.sin(yaw) + dy * math.cos(yaw)


@entry
def project_all(line: Floats, first: int, last: int, actors: Floats) -> Floats:
    """Apply `project` to every row of `actors` (x and y come first): (k, 2)."""
    found = np.empty((len(actors), 2))
    for i in range(len(actors)):
        found[i, 0], found[i, 1] = project(line, first, last, actors[i, X], actors[i, Y])
    return found


@entry
def nearest_ahead(
    route: Floats, progress: int, ego: tuple[float, float, float, float], actors: Floats
) -> tuple[float, float]:
    """Return (bumper-to-bumper metres, speed along the route) of the first body in the ego's corridor, or (inf, 0).

    `ego` is x, y, length, width; `actors` (k, >=6) holds x, y, yaw, speed, length, width.
    """
    x, y, length, width = ego
    s, _ = project(route, progress - 5, progress + 10, x, y)
    gap, speed = math.inf, 0.0
    for i in range(len(actors)):
        other = actors[i]
        if abs(other[X] - x) > _AHEAD_M or abs(other[Y] - y) > _AHEAD_M:
            continue
        at, right = project(route, progress - 5, progress + _AHEAD_M, other[X], other[Y])
        turn = route[int(min(max(at, 0.0), len(route) - 1.0)), 2] - other[YAW]
        co, si = abs(math.cos(turn)), abs(math.sin(turn))
        found = at - s - 0.5 * (length + co * other[LENGTH] + si * other[WIDTH])
        beside = 0.5 * (width + co * other[WIDTH] + si * other[LENGTH])
        if at > s and abs(right) < beside and found < gap:
            gap, speed = found, max(0.0, other[SPEED] * math.cos(turn))
    return gap, speed


@entry
def leaders(path: Floats, s0: float, actors: Floats) -> Ints:
    """Return 1 for everybody ahead in the ego's own corridor who drives the same way: they may brake at any moment."""
    found = np.zeros(len(actors), dtype=np.int64)
    row = int(max(s0, 0.0))
    for i in range(len(actors)):
        at, right = project(path, row - 5, row + 80, actors[i, X], actors[i, Y])
        k = int(min(max(at, 0.0), len(path) - 1.0))
        same_way = math.cos(path[k, 2] - actors[i, YAW]) > 0.8
        if same_way and at > s0 + 1.0 and abs(right) < _SAME_LANE_M:
            found[i] = 1
    return found


@entry
def crossed_boxes(path: Floats, boxes: Floats, moving: Floats) -> Ints:
    """Return 1 for every junction (first row, last row of `path`) that somebody else is about to drive through.

    `moving` is (k, steps, 4): the tracks of everybody but those who lead or follow the ego.
    """
    found = np.zeros(len(boxes), dtype=np.int64)
    for b in range(len(boxes)):
        middle = int(0.5 * (boxes[b, 0] + boxes[b, 1]))
        reach = 0.5 * (boxes[b, 1] - boxes[b, 0]) + 3.0
        for i in range(len(moving)):
            if moving[i, 0, 3] < 0.5:
                continue
            for step in range(moving.shape[1]):
                dx, dy = moving[i, step, 0] - path[middle, 0], moving[i, step, 1] - path[middle, 1]
                if dx * dx + dy * dy < reach * reach:
                    found[b] = 1
                    break
    return found
