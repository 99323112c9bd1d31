"""What will happen if the ego drives like this? Tracks of everybody else, and plans of the ego tried against them.

Compiled. One file on purpose: numba's cache notices changes of the file of a kernel only, not of its helpers'.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = [
    "STEP_S",
    "crossed_boxes",
    "lane_under",
    "leaders",
    "nearest_ahead",
    "project",
    "project_all",
    "rollouts",
    "tracks",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_jit = numba.njit(cache=True)

STEP_S = 0.2
DRIVE_LAG = 0.4
"""The engine gives so much of what is asked for in the first step."""
LEADER_BRAKE_MPS2 = 5.5
"""How hard somebody ahead may brake."""
SETTLE_MPS2 = 2.5
"""How hard the ego slows down for a lower speed limit."""
ACCELERATE_S = 1.6
"""Who accelerates or brakes now is expected to go on with it for this long."""
FASTEST_MPS = 18.0
"""Nobody is expected to accelerate beyond this."""
NOTICED_M = 1.0
"""Who follows is expected to brake for the ego once its middle is so near to the middle of the lane."""
PUSHED_MPS = 9.0
"""Nobody faster than this is expected to brake for an ego that pushes its way across."""
NOSE_M, TAIL_M, HARD_BRAKE_MPS2 = 2.5, 3.0, 6.0
"""With so much of its nose in a junction the ego still waits before it, unless it cannot stop any more."""
BICYCLE_WIDTH_M = 1.0
"""Nobody narrower than this is expected to brake for the ego."""
LANE_REACH_M = 3.3
A_X, A_Y, A_YAW, A_SPEED, A_LENGTH, A_WIDTH, A_ACCEL = range(7)


@_jit
def project(line: Floats, first: int, last: int, x: float, y: float) -> tuple[float, float]:
    """(row, metres to the right) of the nearest place among the rows `first`..`last` of a line (n, >=3)."""
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


@_jit
def project_all(line: Floats, first: int, last: int, actors: Floats) -> Floats:
    """`project` for every row of `actors` (x and y come first): (k, 2)."""
    found = np.empty((len(actors), 2))
    for i in range(len(actors)):
        found[i, 0], found[i, 1] = project(line, first, last, actors[i, A_X], actors[i, A_Y])
    return found


@_jit
def nearest_ahead(
    route: Floats, progress: int, ego: tuple[float, float, float, float], actors: Floats
) -> tuple[float, float]:
    """(bumper-to-bumper metres, speed along the route) of the first body in the ego's corridor, or (inf, 0).

    `ego` is x, y, length, width; `actors` (k, >=6) holds x, y, yaw, speed, length, width.
    """
    x, y, length, width = ego
    s, _ = project(route, progress - 5, progress + 10, x, y)
    gap, speed = math.inf, 0.0
    for i in range(len(actors)):
        other = actors[i]
        if abs(other[0] - x) > 70.0 or abs(other[1] - y) > 70.0:
            continue
        at, right = project(route, progress - 5, progress + 70, other[0], other[1])
        turn = route[int(min(max(at, 0.0), len(route) - 1.0)), 2] - other[A_YAW]
        co, si = abs(math.cos(turn)), abs(math.sin(turn))
        found = at - s - 0.5 * (length + co * other[A_LENGTH] + si * other[A_WIDTH])
        beside = 0.5 * (width + co * other[A_WIDTH] + si * other[A_LENGTH])
        if at > s and abs(right) < beside and found < gap:
            gap, speed = found, max(0.0, other[A_SPEED] * math.cos(turn))
    return gap, speed


@_jit
def lane_under(points: Floats, owner: Ints, x: float, y: float, yaw: float, reach_m: float) -> tuple[int, float]:
    """(row of `points`, metres to the right of it) of the nearest lane that leads about where `yaw` does, or (-1, 0).

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


@_jit
def tracks(
    actors: Floats, follows: Ints, points: Floats, owner: Ints, first: Ints, after: Ints, steps: int
) -> tuple[Floats, Ints]:
    """Where everybody will be: (k, steps + 1, 4) of x, y, yaw, speed every `STEP_S`, and the row of the lane of each.

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
            if abs(slip) > 0.04:
                rate = abs(v * slip)
                target = 0.0 if lat * slip < 0.0 else math.copysign(3.5, slip)
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


@_jit
def leaders(path: Floats, s0: float, actors: Floats) -> Ints:
    """1 for everybody ahead in the ego's own corridor who drives the same way: they may brake at any moment."""
    found = np.zeros(len(actors), dtype=np.int64)
    row = int(max(s0, 0.0))
    for i in range(len(actors)):
        at, right = project(path, row - 5, row + 80, actors[i, A_X], actors[i, A_Y])
        k = int(min(max(at, 0.0), len(path) - 1.0))
        same_way = math.cos(path[k, 2] - actors[i, A_YAW]) > 0.8
        if same_way and at > s0 + 1.0 and abs(right) < 1.7:
            found[i] = 1
    return found


@_jit
def crossed_boxes(path: Floats, boxes: Floats, moving: Floats) -> Ints:
    """1 for every junction (first row, last row of `path`) that somebody else is about to drive through.

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
def _pose(path: Floats, s: float) -> tuple[float, float, float]:
    k = int(min(max(s, 0.0), len(path) - 2.0))
    share = s - k
    x = path[k, 0] + share * (path[k + 1, 0] - path[k, 0])
    y = path[k, 1] + share * (path[k + 1, 1] - path[k, 1])
    return x, y, path[k, 2]


@_jit
def _near(path: Floats, s0: float, reach: float, forecast: Floats, sizes: Floats) -> Ints:
    """Numbers of those who come near the next `reach` metres of the path at all."""
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


@_jit
def rollouts(
    path: Floats, s0: float, v0: float, size: Floats, forecast: Floats, sizes: Floats, leads: Ints, plans: Floats,
    limits: Floats, boxes: Floats, stop_s: float, margins: Floats, yields_mps2: float, pushy: bool,
) -> tuple[Floats, Floats]:  # fmt: skip
    """(seconds until trouble, metres driven until then) for each plan; without trouble that is the whole horizon.

    `path` is (n, 3) x, y, yaw, about one row a metre; `forecast` comes from `tracks` and sets the horizon; `sizes` is
    (k, 2) length, width; `plans` (m, 3) accelerate at [0] for [1] seconds, then at [2]. `limits` is the speed limit of
    each row. `margins` are metres added to the ego's length, its width, and seconds by which who crosses may come
    earlier or later. Trouble is an overlap of two boxes, the front bumper beyond row `stop_s`, or being within one of
    the `boxes` (first row, last row) at the end although it was possible to wait before it. Who follows is expected to
    brake for the ego at `yields_mps2`; who crosses only when `pushy`.
    """
    steps = forecast.shape[1] - 1
    found, driven = np.full(len(plans), steps * STEP_S), np.zeros(len(plans))
    fastest = v0
    for k in range(int(min(max(s0, 0.0), len(limits) - 1.0)), len(limits)):
        fastest = max(fastest, limits[k])
    near = _near(path, s0, min(fastest, v0 + 5.0 * steps * STEP_S) * steps * STEP_S, forecast, sizes)
    half, width, length = 0.5 * size[0], size[1] + margins[1], size[0] + margins[0]
    clock, speed = np.empty(len(near)), np.empty(len(near))
    close = np.zeros(len(near), dtype=np.int64)
    x, y, yaw = _pose(path, s0)
    for j in range(len(near)):  # who is within the margins already cannot be kept out of them
        a = forecast[near[j], 0]
        if _touch(x, y, yaw, length, width, a[0], a[1], a[2], sizes[near[j], 0], sizes[near[j], 1]):
            close[j] = 1
    for p in range(len(plans)):
        s, v = s0, v0
        for j in range(len(near)):
            clock[j], speed[j] = 0.0, forecast[near[j], 0, 3]
        for step in range(1, steps + 1):
            limit = limits[int(min(max(s, 0.0), len(limits) - 1.0))]
            now = plans[p, 0] if step * STEP_S <= plans[p, 1] + 1e-9 else plans[p, 2]
            if step == 1 and now > 0.0:
                now *= DRIVE_LAG
            after = max(0.0, v + now * STEP_S)
            if after > limit:
                after = min(after, max(limit, v - SETTLE_MPS2 * STEP_S))
            s += 0.5 * (v + after) * STEP_S
            v = after
            x, y, yaw = _pose(path, s)
            trouble = s + half > stop_s
            for j in range(len(near)):
                if trouble:
                    break
                i = near[j]
                # the place of somebody on the track: the clock runs slower for who brakes
                k = int(min(clock[j], steps - 1.0))
                share = min(clock[j] - k, 1.0)
                a, b = forecast[i, k], forecast[i, k + 1]
                oyaw = a[2]
                ox, oy = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
                planned = max(a[3], 0.01)
                co, so = math.cos(oyaw), math.sin(oyaw)
                rx, ry = x - ox, y - oy
                in_front, beside = rx * co + ry * so, abs(-rx * so + ry * co)
                aligned = math.cos(yaw - oyaw)
                speed_now = min(speed[j] + 2.5 * STEP_S, planned) if leads[i] == 0 else speed[j]
                least = -0.5 if pushy and speed[j] < PUSHED_MPS else 0.6
                expected = sizes[i, 1] > BICYCLE_WIDTH_M and aligned > least
                if expected and 0.0 < in_front < 40.0 and beside < NOTICED_M and step > 2:
                    gap = in_front - 0.5 * (size[0] + sizes[i, 0])
                    closing = max(speed[j] - v, 0.0)
                    if gap < 3.0 + closing * closing / (2.0 * yields_mps2) + 0.4 * speed[j]:
                        speed_now = max(min(v, speed[j]), speed[j] - yields_mps2 * STEP_S)
                if leads[i] == 1:
                    speed_now = max(0.0, speed[j] - LEADER_BRAKE_MPS2 * STEP_S)
                speed[j] = speed_now
                clock[j] += min(speed_now / planned, 1.5)
                k = int(min(clock[j], steps - 1.0))
                share = min(clock[j] - k, 1.0)
                a, b = forecast[i, k], forecast[i, k + 1]
                ox, oy = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
                reach = 0.5 * (length + width + sizes[i, 0] + sizes[i, 1]) + margins[2] * planned
                if abs(x - ox) > reach or abs(y - oy) > reach:
                    continue
                in_line = leads[i] == 1 or (aligned > 0.8 and beside < 0.5 * (size[1] + sizes[i, 1]))
                stretch = 0.0 if in_line else 2.0 * margins[2] * speed_now
                if close[j] == 1:
                    trouble = _touch(x, y, yaw, size[0], size[1], ox, oy, a[2], sizes[i, 0], sizes[i, 1])
                else:
                    trouble = _touch(x, y, yaw, length, width, ox, oy, a[2], sizes[i, 0] + stretch, sizes[i, 1])
            if trouble:
                found[p] = (step - 1) * STEP_S
                break
        driven[p] = s - s0
        if found[p] < steps * STEP_S - 1e-9 or s - s0 < 0.1 + v0 * v0 / (2.0 * HARD_BRAKE_MPS2):
            continue
        for b in range(len(boxes)):
            before = s0 + half <= boxes[b, 0] + NOSE_M
            if before and s + half > boxes[b, 0] + 0.5 and s - half < boxes[b, 1] - TAIL_M:
                found[p] = 0.1
    return found, driven
