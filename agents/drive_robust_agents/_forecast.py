"""The expert's look into the near future: which accelerations end in a collision? Compiled."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["lateral_target", "project", "rollouts"]

Floats = NDArray[np.float64]
_jit = numba.njit(cache=True)

STEP_S = 0.2
YIELD_MPS2 = 3.0
"""How hard somebody behind is expected to brake once the ego is in the lane."""
COMFORT_BRAKE_MPS2 = 3.2
LEADER_BRAKE_MPS2 = 5.5
"""How hard somebody ahead may brake."""


@_jit
def project(route: Floats, first: int, x: float, y: float) -> tuple[float, float]:
    """(row, metres to the right) of the nearest place of the route among the rows from `first` - 5 to `first` + 80."""
    best, at = 1e18, first
    for k in range(max(0, first - 5), min(len(route), first + 80)):
        dx, dy = x - route[k, 0], y - route[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
    yaw = route[at, 2]
    dx, dy = x - route[at, 0], y - route[at, 1]
    return at + dx * math.cos(yaw) + dy * math.sin(yaw), -dx * math.sin(yaw) + dy * math.cos(yaw)


@_jit
def lateral_target(plan: Floats, s: float) -> float:
    """Metres to the right of the route at row `s`.

    `plan` is (from row, from m, at row, hold m, until row, back at row, back to m).
    """
    if s < plan[4]:
        start, end, before, after = plan[0], plan[2], plan[1], plan[3]
    else:
        start, end, before, after = plan[4], plan[5], plan[3], plan[6]
    t = min(max((s - start) / max(end - start, 1e-6), 0.0), 1.0)
    return float(before + (after - before) * t * t * (3.0 - 2.0 * t))


@_jit
def _pose(route: Floats, s: float, right: float) -> tuple[float, float, float]:
    k = int(min(max(s, 0.0), len(route) - 1.001))
    share = s - k
    nxt = min(k + 1, len(route) - 1)
    yaw = route[k, 2]
    x = route[k, 0] + share * (route[nxt, 0] - route[k, 0])
    y = route[k, 1] + share * (route[nxt, 1] - route[k, 1])
    if k >= len(route) - 2:
        x = route[-1, 0] + (s - len(route) + 1) * math.cos(yaw)
        y = route[-1, 1] + (s - len(route) + 1) * math.sin(yaw)
    return x - right * math.sin(yaw), y + right * math.cos(yaw), yaw


@_jit
def _touch(
    x: float, y: float, yaw: float, length: float, width: float, ox: float, oy: float, oyaw: float, olength: float,
    owidth: float,
) -> bool:  # fmt: skip
    dx, dy = x - ox, y - oy
    reach = 0.5 * (length + width + olength + owidth)
    if abs(dx) > reach or abs(dy) > reach:
        return False
    for axis in range(4):
        angle = (yaw if axis < 2 else oyaw) + (axis % 2) * math.pi / 2.0
        mine = 0.5 * (abs(math.cos(angle - yaw)) * length + abs(math.sin(angle - yaw)) * width)
        theirs = 0.5 * (abs(math.cos(angle - oyaw)) * olength + abs(math.sin(angle - oyaw)) * owidth)
        if abs(dx * math.cos(angle) + dy * math.sin(angle)) >= mine + theirs:
            return False
    return True


@_jit
def _leaders(route: Floats, plan: Floats, s0: float, actors: Floats) -> NDArray[np.int64]:
    """1 for everybody ahead in the ego's own corridor who drives the same way: they may brake at any moment."""
    found = np.zeros(len(actors), dtype=np.int64)
    first = int(max(s0, 0.0))
    for i in range(len(actors)):
        at, right = project(route, first, actors[i, 0], actors[i, 1])
        k = int(min(max(at, 0.0), len(route) - 1.0))
        same_way = math.cos(route[k, 2] - actors[i, 2]) > 0.8
        if same_way and at > s0 + 1.0 and abs(right - lateral_target(plan, at)) < 1.7:
            found[i] = 1
    return found


@_jit
def rollouts(
    route: Floats, plan: Floats, s0: float, v0: float, size: Floats, actors: Floats, accelerations: Floats,
    limits: Floats, box: Floats, stop_s: float, margins: Floats, pushy: bool, horizon_s: float, brake_after_s: float,
) -> Floats:  # fmt: skip
    """Seconds until trouble for each acceleration, braking again after `brake_after_s` (`horizon_s`: no trouble).

    `actors` is (k, 6): x, y, yaw, speed, length, width. `limits` is the speed limit of each row. Trouble is a box
    overlap (`margins`: metres added to the ego's length and width), the front bumper beyond row `stop_s`, or a stop
    within the junction `box` (first row, last row) that could have been made before it. Who follows is expected to
    brake for the ego; who crosses only when `pushy`.
    """
    found = np.full(len(accelerations), horizon_s)
    steps = int(horizon_s / STEP_S)
    k_actors = len(actors)
    for a in range(len(accelerations)):
        s, v = s0, v0
        state = actors.copy()
        leads = _leaders(route, plan, s0, actors)
        for step in range(1, steps + 1):
            limit = limits[int(min(max(s, 0.0), len(limits) - 1.0))]
            now = accelerations[a]
            if step * STEP_S > brake_after_s:
                now = min(now, -COMFORT_BRAKE_MPS2)
            after = max(0.0, v + now * STEP_S)
            if now > 0.0:
                after = min(after, max(limit, v))
            s += 0.5 * (v + after) * STEP_S
            v = after
            x, y, yaw = _pose(route, s, lateral_target(plan, s))
            ahead_x, ahead_y, _ = _pose(route, s + 1.0, lateral_target(plan, s + 1.0))
            yaw = math.atan2(ahead_y - y, ahead_x - x)
            trouble = s + 0.5 * size[0] > stop_s
            for i in range(k_actors):
                other = state[i]
                rx, ry = x - other[0], y - other[1]
                co, so = math.cos(other[2]), math.sin(other[2])
                in_front = rx * co + ry * so
                beside = abs(-rx * so + ry * co)
                aligned = math.cos(yaw - other[2]) > (-0.5 if pushy else 0.6)
                if aligned and 0.0 < in_front < 30.0 and beside < 0.5 * (size[1] + other[5]) and step > 2:
                    gap = in_front - 0.5 * (size[0] + other[4])
                    if gap < 4.0 + 0.8 * max(other[3] - v, 0.0) + other[3] * 0.6:
                        other[3] = max(min(v, other[3]), other[3] - YIELD_MPS2 * STEP_S)
                if leads[i] == 1:
                    other[3] = max(0.0, other[3] - LEADER_BRAKE_MPS2 * STEP_S)
                other[0] += other[3] * co * STEP_S
                other[1] += other[3] * so * STEP_S
                if _touch(
                    x,
                    y,
                    yaw,
                    size[0] + margins[0],
                    size[1] + margins[1],
                    other[0],
                    other[1],
                    other[2],
                    other[4],
                    other[5],
                ):
                    trouble = True
            if trouble:
                found[a] = (step - 1) * STEP_S
                break
            front, rear = s + 0.5 * size[0], s - 0.5 * size[0]
            if v <= 0.0 and s0 + 0.5 * size[0] <= box[0] + 0.5 < front and rear < box[1] and brake_after_s < horizon_s:
                found[a] = 0.1
                break
    return found
