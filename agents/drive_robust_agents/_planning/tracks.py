"""Predict the tracks of all actors along their lanes; compiled."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning import columns as box
from pytest_drive_robust.jit.arrays import Floats, Floats2, Ints1
from pytest_drive_robust.jit.kernels import entry

__all__ = ["STEP_S", "lane_under", "tracks"]

STEP_S = 0.2
"""Seconds between consecutive places of a track."""
_ACCELERATE_S = 1.6
"""Time for which an actor is expected to keep its present acceleration."""
_FASTEST_MPS = 18.0
"""Speed beyond which no actor is expected to accelerate."""
_LANE_REACH_M = 3.3
"""Greatest distance of an actor from a lane that it follows; farther actors are expected to go straight on."""
_SLIP, _NEIGHBOUR_M = 0.04, 3.5
"""An actor whose heading differs from the lane by more than this moves to the lane's middle, or to the next lane."""
_TAKEN = 0.35
"""Share of a junction lane after which an actor is known to have taken that lane."""


@entry
def lane_under(points: Floats2, x: float, y: float, c: float, s: float, reach_m: float) -> tuple[int, float]:
    """Return (row of `points`, metres to its right) of the nearest lane that leads about the same way, or (-1, 0).

    `points` is (p, 5): the centre lines of all lanes, one after the other: x, y, yaw, cosine and sine of yaw. The
    direction to compare with is (`c`, `s`).
    """
    best, at = reach_m * reach_m, -1
    for k in range(len(points)):
        dx = x - points[k, 0]
        if dx > reach_m or dx < -reach_m:
            continue
        dy = y - points[k, 1]
        d = dx * dx + dy * dy
        if d < best and points[k, 3] * c + points[k, 4] * s > 0.8:
            best, at = d, k
    if at < 0:
        return -1, 0.0
    return at, (y - points[at, 1]) * points[at, 3] - (x - points[at, 0]) * points[at, 4]


@entry
def tracks(
    actors: Floats2, follows: Ints1, points: Floats2, owner: Ints1, first: Ints1, after: Ints1,
    entries: Ints1, feeders: Ints1, steps: int,
) -> Floats:  # fmt: skip
    """Predict all actors: (k, steps + 1, 6) of x, y, yaw, speed, cosine and sine of yaw every `STEP_S`.

    `actors` is (k, 9) as `Traffic.boxes`. An actor with `follows` 1 follows the lane below it and keeps or finishes a
    sideways movement. Every other actor goes straight on. `points` is as in `lane_under`, `owner` is the lane of each
    point, `first` the start of each lane in `points`, `after` the lane taken behind each lane, or -1.

    Afterwards the ways taken at forks are learnt: a junction lane with an actor becomes the `after` of the lanes that
    lead into it, the `feeders` from `entries[lane]` to `entries[lane + 1]` (none for lanes outside of junctions).
    """
    found = np.empty((len(actors), steps + 1, 6))
    under = np.full(len(actors), -1, dtype=np.int64)
    for i in range(len(actors)):
        x, y, yaw, v = actors[i, box.X], actors[i, box.Y], actors[i, box.YAW], actors[i, box.SPEED]
        accel, c, s = actors[i, box.ACCEL], actors[i, box.COS], actors[i, box.SIN]
        row, lat, slips, target = -1, 0.0, 0.0, 0.0
        at, lane = 0.0, -1
        if follows[i] == 1 and v > 0.05:
            row, lat = lane_under(points, x, y, c, s, _LANE_REACH_M)
        under[i], target = row, lat
        if row >= 0:
            slip = s * points[row, 3] - c * points[row, 4]
            if abs(slip) > _SLIP:
                slips = abs(slip)
                target = 0.0 if lat * slip < 0.0 else math.copysign(_NEIGHBOUR_M, slip)
            lane = owner[row]
            at = (
                float(row - first[lane]) + (x - points[row, 0]) * points[row, 3] + (y - points[row, 1]) * points[row, 4]
            )
        for step in range(steps + 1):
            found[i, step, 0], found[i, step, 1], found[i, step, 2] = x, y, yaw
            found[i, step, 3], found[i, step, 4], found[i, step, 5] = v, c, s
            if step * STEP_S < _ACCELERATE_S:
                v = min(max(v + accel * STEP_S, 0.0), max(v, _FASTEST_MPS))
            ds = v * STEP_S
            if lane < 0:
                x, y = x + ds * c, y + ds * s
                continue
            at += ds
            size = first[lane + 1] - first[lane]
            while at > size - 1 and after[lane] >= 0:
                at -= size - 1
                lane = after[lane]
                size = first[lane + 1] - first[lane]
            k = first[lane] + int(min(max(at, 0.0), size - 1.0))
            lat += min(max(target - lat, -slips * ds), slips * ds)
            rest = at - (k - first[lane])
            yaw, c, s = points[k, 2], points[k, 3], points[k, 4]
            x, y = points[k, 0] + rest * c - lat * s, points[k, 1] + rest * s + lat * c
    for i in range(len(actors)):
        if under[i] >= 0:
            lane = owner[under[i]]
            if under[i] - first[lane] > _TAKEN * (first[lane + 1] - first[lane]):
                for k in range(entries[lane], entries[lane + 1]):
                    after[feeders[k]] = lane
    return found
