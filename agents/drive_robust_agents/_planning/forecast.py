"""Try the ego's plans against the tracks of everybody else: when is there trouble? Compiled."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.jit import entry, inner, sources_digest
from drive_robust_agents._planning.tracks import STEP_S

__all__ = ["rollouts"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DRIVE_LAG = 0.4
"""The engine gives so much of what is asked for in the first step."""
SETTLE_MPS2 = 2.5
"""How hard the ego slows down for a lower speed limit."""
LEADER_BRAKE_MPS2, RECOVER_MPS2 = 5.5, 2.5
"""How hard somebody ahead may brake, and how hard somebody who braked for the ego accelerates again."""
NOTICED_M, NOTICED_STEPS = 1.0, 2
"""Who follows is expected to brake for the ego once its middle is so near to his line, and after so many steps."""
BICYCLE_WIDTH_M = 1.0
"""Nobody narrower than this is expected to brake for the ego."""
PUSHED_MPS = 9.0
"""Nobody faster than this is expected to brake for an ego that pushes its way across."""
NOSE_M, TAIL_M, HARD_BRAKE_MPS2 = 2.5, 3.0, 6.0
"""With so much of its nose in a junction the ego still waits before it, unless it cannot stop any more; with so much
of its tail in it, it is out."""


@inner
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


@inner
def _pose(path: Floats, s: float) -> tuple[float, float, float]:
    k = int(min(max(s, 0.0), len(path) - 2.0))
    share = s - k
    x = path[k, 0] + share * (path[k + 1, 0] - path[k, 0])
    y = path[k, 1] + share * (path[k + 1, 1] - path[k, 1])
    return x, y, path[k, 2]


@inner
def _near(path: Floats, s0: float, reach: float, forecast: Floats, sizes: Floats) -> Ints:
    """Return the numbers of those who come near the next `reach` metres of the path at all."""
    a, b = int(min(max(s0 - 10.0, 0.0), len(path) - 1.0)), int(min(s0 + reach + 6.0, len(path) - 1.0)) + 1
    left, right, low, high = path[a, 0], path[a, 0], path[a, 1], path[a, 1]
    for k in range(a, b):
        left, right = min(left, path[k, 0]), max(right, path[k, 0])
        low, high = min(low, path[k, 1]), max(high, path[k, 1])
    beyond = max(0.0, s0 + reach - len(path))
    left, right, low, high = left - beyond, right + beyond, low - beyond, high + beyond
    found = np.empty(len(forecast), dtype=np.int64)
    count = 0
    for i in range(len(forecast)):
        margin = 4.0 + 0.5 * (sizes[i, 0] + sizes[i, 1])
        for step in range(forecast.shape[1]):
            x, y = forecast[i, step, 0], forecast[i, step, 1]
            if left - margin < x < right + margin and low - margin < y < high + margin:
                found[count] = i
                count += 1
                break
    return found[:count]


@inner
def _ego_speed(v: float, accel: float, limit: float) -> float:
    """Return the ego's speed a step later: never backwards, and settling to the limit."""
    after = max(0.0, v + accel * STEP_S)
    if after > limit:
        after = min(after, max(limit, v - SETTLE_MPS2 * STEP_S))
    return float(after)


@inner
def _place(track: Floats, clock: float) -> tuple[float, float, float, float]:
    """Return x, y, yaw, speed on a track, `clock` steps from now."""
    k = int(min(clock, len(track) - 2.0))
    share = min(clock - k, 1.0)
    a, b = track[k], track[k + 1]
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2], a[3]


@inner
def _gives_way(gap: float, speed: float, v: float, yields_mps2: float) -> bool:
    """Return whether the ego is so near ahead of somebody that he brakes for it."""
    closing = max(speed - v, 0.0)
    return gap < 3.0 + closing * closing / (2.0 * yields_mps2) + 0.4 * speed


@inner
def _stays_out(s0: float, s: float, v0: float, half: float, boxes: Floats) -> bool:
    """Return False when a plan ends within a junction that it could have waited for."""
    if s - s0 < 0.1 + v0 * v0 / (2.0 * HARD_BRAKE_MPS2):
        return True
    for b in range(len(boxes)):
        before = s0 + half <= boxes[b, 0] + NOSE_M
        if before and s + half > boxes[b, 0] + 0.5 and s - half < boxes[b, 1] - TAIL_M:
            return False
    return True


@inner
def _hits(
    pose: tuple[float, float, float], v: float, step: int, track: Floats, other: Floats, moving: Floats, ego: Floats,
    margins: Floats, yields_mps2: float, pushy: bool,
) -> bool:  # fmt: skip
    """Return whether the ego at `pose` hits somebody, who moves on by one step of his own.

    `other` is length, width, 1 for a leader, 1 for somebody within the margins from the start; `moving` is his clock
    and his speed, both are updated: the clock runs slower for who brakes.
    """
    x, y, yaw = pose
    length, width, leads, close = other
    ox, oy, oyaw, planned = _place(track, moving[0])
    planned = max(planned, 0.01)
    co, so = math.cos(oyaw), math.sin(oyaw)
    in_front, beside = (x - ox) * co + (y - oy) * so, abs(-(x - ox) * so + (y - oy) * co)
    aligned, speed = math.cos(yaw - oyaw), moving[1]
    if leads > 0.0:
        moving[1] = max(0.0, speed - LEADER_BRAKE_MPS2 * STEP_S)
    else:
        moving[1] = min(speed + RECOVER_MPS2 * STEP_S, planned)
        least = -0.5 if pushy and speed < PUSHED_MPS else 0.6
        sees = 0.0 < in_front < 40.0 and beside < NOTICED_M and aligned > least and step > NOTICED_STEPS
        gap = in_front - 0.5 * (ego[0] + length)
        if sees and width > BICYCLE_WIDTH_M and _gives_way(gap, speed, v, yields_mps2):
            moving[1] = max(min(v, speed), speed - yields_mps2 * STEP_S)
    moving[0] += min(moving[1] / planned, 1.5)
    ox, oy, oyaw, _ = _place(track, moving[0])
    reach = 0.5 * (ego[0] + margins[0] + ego[1] + margins[1] + length + width) + margins[2] * planned
    if abs(x - ox) > reach or abs(y - oy) > reach:
        return False
    if close > 0.0:
        return _touch(x, y, yaw, ego[0], ego[1], ox, oy, oyaw, length, width)
    in_line = leads > 0.0 or (aligned > 0.8 and beside < 0.5 * (ego[1] + width))
    stretch = 0.0 if in_line else 2.0 * margins[2] * moving[1]
    return _touch(x, y, yaw, ego[0] + margins[0], ego[1] + margins[1], ox, oy, oyaw, length + stretch, width)


@inner
def _others(
    path: Floats, s0: float, near: Ints, forecast: Floats, sizes: Floats, leads: Ints, ego: Floats, margins: Floats
) -> Floats:
    """Return the `other` rows of `_hits`."""
    found = np.empty((len(near), 4))
    x, y, yaw = _pose(path, s0)
    for j in range(len(near)):
        i = near[j]
        a, length, width = forecast[i, 0], sizes[i, 0], sizes[i, 1]
        # who is within the margins already cannot be kept out of them
        close = _touch(x, y, yaw, ego[0] + margins[0], ego[1] + margins[1], a[0], a[1], a[2], length, width)
        found[j, 0], found[j, 1], found[j, 2], found[j, 3] = length, width, float(leads[i]), 1.0 if close else 0.0
    return found


@inner
def _rollouts(
    path: Floats, s0: float, v0: float, size: Floats, forecast: Floats, sizes: Floats, leads: Ints, plans: Floats,
    limits: Floats, boxes: Floats, stop_s: float, margins: Floats, yields_mps2: float, pushy: bool,
) -> tuple[Floats, Floats]:  # fmt: skip
    steps, half = forecast.shape[1] - 1, 0.5 * size[0]
    found, driven = np.full(len(plans), steps * STEP_S), np.zeros(len(plans))
    fastest = v0
    for k in range(int(min(max(s0, 0.0), len(limits) - 1.0)), len(limits)):
        fastest = max(fastest, limits[k])
    near = _near(path, s0, min(fastest, v0 + 5.0 * steps * STEP_S) * steps * STEP_S, forecast, sizes)
    others = _others(path, s0, near, forecast, sizes, leads, size, margins)
    moving = np.empty((len(near), 2))
    for p in range(len(plans)):
        s, v = s0, v0
        for j in range(len(near)):
            moving[j, 0], moving[j, 1] = 0.0, forecast[near[j], 0, 3]
        for step in range(1, steps + 1):
            accel = plans[p, 0] if step * STEP_S <= plans[p, 1] + 1e-9 else plans[p, 2]
            if step == 1 and accel > 0.0:
                accel *= DRIVE_LAG
            after = _ego_speed(v, accel, limits[int(min(max(s, 0.0), len(limits) - 1.0))])
            s += 0.5 * (v + after) * STEP_S
            v = after
            pose = _pose(path, s)
            trouble = s + half > stop_s
            for j in range(len(near)):
                if trouble:
                    break
                trouble = _hits(
                    pose, v, step, forecast[near[j]], others[j], moving[j], size, margins, yields_mps2, pushy
                )
            if trouble:
                found[p] = (step - 1) * STEP_S
                break
        driven[p] = s - s0
        if found[p] >= steps * STEP_S - 1e-9 and not _stays_out(s0, s, v0, half, boxes):
            found[p] = 0.1
    return found, driven


def _entry(sources: int) -> Callable[..., tuple[Floats, Floats]]:
    @entry
    def rollouts(
        path: Floats, s0: float, v0: float, size: Floats, forecast: Floats, sizes: Floats, leads: Ints, plans: Floats,
        limits: Floats, boxes: Floats, stop_s: float, margins: Floats, yields_mps2: float, pushy: bool,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        _ = sources  # part of the cache's key
        return _rollouts(
            path, s0, v0, size, forecast, sizes, leads, plans, limits, boxes, stop_s, margins, yields_mps2, pushy
        )

    return rollouts


rollouts = _entry(sources_digest())
"""(seconds until trouble, metres driven until then) for each plan; without trouble that is the whole horizon.

`path` is (n, 3) x, y, yaw, about one row a metre; `forecast` comes from `tracks.tracks` and sets the horizon;
`sizes` is (k, 2) length, width; `plans` (m, 3) accelerate at [0] for [1] seconds, then at [2]. `limits` is the
speed limit of each row. `margins` are metres added to the ego's length, its width, and seconds by which who crosses
may come earlier or later. Trouble is an overlap of two boxes, the front bumper beyond row `stop_s`, or being within
one of the `boxes` (first row, last row) at the end although it was possible to wait before it. Who follows is
expected to brake for the ego at `yields_mps2`; who crosses only when `pushy`.
"""
