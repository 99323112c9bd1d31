"""Where everybody else is going: along their lanes, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.jit import entry

__all__ = ["STEP_S", "lane_under", "tracks"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP_S = 0.2
"""Seconds between two places of a track."""
ACCELERATE_S = 1.6
"""Who accelerates or brakes now is expected to go on with it for this long."""
FASTEST_MPS = 18.0
"""Nobody is expected to accelerate beyond this."""
LANE_REACH_M = 3.3
"""Who is farther aside of every lane is expected to go straight on."""
SLIP, NEIGHBOUR_M = 0.04, 3.5
"""Whose nose points aside of the lane by more than this is changing to the middle of it, or to the next one."""
A_X, A_Y, A_YAW, A_SPEED, A_LENGTH, A_WIDTH, A_ACCEL = range(7)


@entry
def lane_under(points: Floats, owner: Ints, x: float, y: float, yaw: float, reach_m: float) -> tuple[int, float]:
    """Return (row of `points`, metres to its right) of the nearest lane that leads about where `yaw` does, or (-1, 0).

    `points` is (p, 3): the centre lines of all lanes, one after the other; `owner` is the lane of each.
    """
    best, at = reach_m * reach_m, -1
    co, so = math.cos(yaw), math.sin(yaw)
    for k in range(len(points)):
        dx = x - points[k, 0]
        if dx > reach_m or dx < -reach_m:
            continue
        dy = y - points[k, 1]
        d = dx * dx + dy * dy
        if d < best and math.cos(points[k, 2]) * co + math.sin(points[k, 2]) * so > 0.8:
            best, at = d, k
    if at < 0:
        return -1, 0.0
    heading = points[at, 2]
    return at, -(x - points[at, 0]) * math.sin(heading) + (y - points[at, 1]) * math.cos(heading)


@entry
def tracks(
    actors: Floats, follows: Ints, points: Floats, owner: Ints, first: Ints, after: Ints, steps: int
) -> tuple[Floats, Ints]:
    """Predict where everybody will be.

    Gives (k, steps + 1, 4) of x, y, yaw, speed every `STEP_S`, and the row of the lane of each.

    Who has `follows` 1 goes along the lane underneath (`points`, `owner` as in `lane_under`; `first` is where each lane
    begins in `points`, `after` the lane that is taken behind it, or -1), keeping or finishing a sideways movement.
    Everybody else goes straight on.
    """
    found = np.empty((len(actors), steps + 1, 4))
    under = np.full(len(actors), -1, dtype=np.int64)
    for i in range(len(actors)):
        x, y, yaw, v = actors[i, A_X], actors[i, A_Y], actors[i, A_YAW], actors[i, A_SPEED]
        accel = actors[i, A_ACCEL]
        row, lat = -1, 0.0
        if follows[i] == 1 and v > 0.05:
            row, lat = lane_under(points, owner, x, y, yaw, LANE_REACH_M)
        under[i] = row
        rate, target = 0.0, lat
        if row >= 0:
            slip = math.sin(yaw - points[row, 2])
            if abs(slip) > SLIP:
                rate = abs(v * slip)
                target = 0.0 if lat * slip < 0.0 else math.copysign(NEIGHBOUR_M, slip)
        at, lane = 0.0, -1
        if row >= 0:
            lane = owner[row]
            at = float(row - first[lane])
            at += (x - points[row, 0]) * math.cos(points[row, 2]) + (y - points[row, 1]) * math.sin(points[row, 2])
        for step in range(steps + 1):
            found[i, step, 0], found[i, step, 1], found[i, step, 2], found[i, step, 3] = x, y, yaw, v
            if step * STEP_S < ACCELERATE_S:
                v = min(max(v + accel * STEP_S, 0.0), max(v, FASTEST_MPS))
            ds = v * STEP_S
            if lane < 0:
                x += ds * math.cos(yaw)
                y += ds * math.sin(yaw)
                continue
            at += ds
            size = first[lane + 1] - first[lane]
            while at > size - 1 and after[lane] >= 0:
                at -= size - 1
                lane = after[lane]
                size = first[lane + 1] - first[lane]
            k = first[lane] + int(min(max(at, 0.0), size - 1.0))
            away = min(max(target - lat, -rate * STEP_S), rate * STEP_S)
            lat += away
            heading = points[k, 2]
            rest = at - (k - first[lane])
            x = points[k, 0] + rest * math.cos(heading) - lat * math.sin(heading)
            y = points[k, 1] + rest * math.sin(heading) + lat * math.cos(heading)
            yaw = heading
    return found, under
