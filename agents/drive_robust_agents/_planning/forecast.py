"""Simulate the ego's plans against the predicted tracks of all actors, to find when trouble begins; compiled."""

from __future__ import annotations

import numpy as np

from drive_robust_agents._planning import columns as box
from drive_robust_agents._planning.tracks import STEP_S
from pytest_drive_robust.jit.arrays import Floats, Floats1, Floats2, Floats3, Ints, Ints1
from pytest_drive_robust.jit.kernels import entry, inner

__all__ = ["rollouts"]

_DRIVE_LAG = 0.4
"""Share of the wanted acceleration that the engine gives in the first step."""
_SETTLE_MPS2 = 2.5
"""Deceleration of the ego for a lower speed limit."""
_LEADER_BRAKE_MPS2, _RECOVER_MPS2 = 5.5, 2.5
"""Braking expected of a leader, and acceleration expected of an actor that has braked for the ego."""
_NOTICED_M, _NOTICED_STEPS = 1.0, 2
"""A follower is expected to brake for the ego if the ego's middle is so near to his line, after so many steps."""
_FOLLOWS_COSINE = 0.6
_BICYCLE_WIDTH_M = 1.0
"""Actors narrower than this are not expected to brake for the ego."""
_NOSE_M, _TAIL_M, _HARD_BRAKE_MPS2 = 2.5, 3.0, 6.0
"""With so much of its nose in a junction the ego still waits before it, unless it cannot stop any more; with so much
of its tail in it, it is out."""

_LENGTH, _WIDTH, _LEADS, _CLOSE, _FOLLOWS, _CLOCK, _SPEED = range(7)
"""Columns of the table of near actors during the trial of one plan."""


@inner
def _touch(
    dx: float, dy: float, c: float, s: float, length: float, width: float, oc: float, os: float, olength: float,
    owidth: float,
) -> bool:  # fmt: skip
    """Return whether two boxes overlap: (`dx`, `dy`) from the first to the second, (cosine, sine) of each."""
    reach = 0.5 * (length + width + olength + owidth)
    if abs(dx) > reach or abs(dy) > reach:
        return False
    along, across = abs(c * oc + s * os), abs(c * os - s * oc)
    if abs(dx * c + dy * s) >= 0.5 * (length + along * olength + across * owidth):
        return False
    if abs(dy * c - dx * s) >= 0.5 * (width + across * olength + along * owidth):
        return False
    if abs(dx * oc + dy * os) >= 0.5 * (olength + along * length + across * width):
        return False
    return abs(dy * oc - dx * os) < 0.5 * (owidth + across * length + along * width)


@inner
def _near(path: Floats, s0: float, reach: float, forecast: Floats, actors: Floats, steps: int) -> Ints:
    """Return the numbers of the actors that come near the next `reach` metres of the path."""
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
        margin = 4.0 + 0.5 * (actors[i, box.LENGTH] + actors[i, box.WIDTH])
        for step in range(steps + 1):
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
        after = min(after, max(limit, v - _SETTLE_MPS2 * STEP_S))
    return float(after)


@inner
def _stays_out(s0: float, s: float, v0: float, half: float, junctions: Floats) -> bool:
    """Return False when a plan ends within a junction before which the ego could have waited."""
    if s - s0 < 0.1 + v0 * v0 / (2.0 * _HARD_BRAKE_MPS2):
        return True
    for b in range(len(junctions)):
        before = s0 + half <= junctions[b, 0] + _NOSE_M
        if before and s + half > junctions[b, 0] + 0.5 and s - half < junctions[b, 1] - _TAIL_M:
            return False
    return True


@inner
def _hits(
    x: float, y: float, c: float, s: float, v: float, step: int, forecast: Floats, i: int, steps: int, others: Floats,
    j: int, size: Floats, margins: Floats, yields_mps2: float,
) -> bool:  # fmt: skip
    """Advance an actor, `i` of the forecast and row `j` of `others`, by one step; return whether the ego hits it.

    The actor's clock and speed are updated; the clock runs slower for a braking actor. The actor is expected to brake
    for an ego that it follows already, but not for an ego that comes into its way.
    """
    length, width, clock, speed = others[j, _LENGTH], others[j, _WIDTH], others[j, _CLOCK], others[j, _SPEED]
    leads = others[j, _LEADS] > 0.0
    k = int(min(clock, steps - 1.0))
    share = min(clock - k, 1.0)
    dx = x - forecast[i, k, 0] - share * (forecast[i, k + 1, 0] - forecast[i, k, 0])
    dy = y - forecast[i, k, 1] - share * (forecast[i, k + 1, 1] - forecast[i, k, 1])
    planned, oc, os = max(forecast[i, k, 3], 0.01), forecast[i, k, 4], forecast[i, k, 5]
    in_front, beside, aligned = dx * oc + dy * os, abs(dy * oc - dx * os), c * oc + s * os
    if leads:
        speed = max(0.0, speed - _LEADER_BRAKE_MPS2 * STEP_S)
    else:
        was = speed
        speed = min(was + _RECOVER_MPS2 * STEP_S, planned)
        if others[j, _FOLLOWS] > 0.0 and in_front > 0.0 and step > _NOTICED_STEPS:
            closing, gap = max(was - v, 0.0), in_front - 0.5 * (size[0] + length)
            if gap < 3.0 + closing * closing / (2.0 * yields_mps2) + 0.4 * was:
                speed = max(min(v, was), was - yields_mps2 * STEP_S)
    clock += min(speed / planned, 1.5)
    others[j, _CLOCK], others[j, _SPEED] = clock, speed
    k = int(min(clock, steps - 1.0))
    share = min(clock - k, 1.0)
    dx = forecast[i, k, 0] + share * (forecast[i, k + 1, 0] - forecast[i, k, 0]) - x
    dy = forecast[i, k, 1] + share * (forecast[i, k + 1, 1] - forecast[i, k, 1]) - y
    reach = 0.5 * (size[0] + margins[0] + size[1] + margins[1] + length + width) + margins[2] * planned
    if abs(dx) > reach or abs(dy) > reach:
        return False
    oc, os = forecast[i, k, 4], forecast[i, k, 5]
    if others[j, _CLOSE] > 0.0:
        return bool(_touch(dx, dy, c, s, size[0], size[1], oc, os, length, width))
    if not leads and (aligned <= 0.8 or beside >= 0.5 * (size[1] + width)):
        length += 2.0 * margins[2] * speed
    return bool(_touch(dx, dy, c, s, size[0] + margins[0], size[1] + margins[1], oc, os, length, width))


@inner
def _leads_over(forecast: Floats, i: int, steps: int, x: float, y: float, c: float, s: float) -> bool:
    """Return whether an actor's track leads from behind over the place (x, y), in about the direction (c, s)."""
    for step in range(steps):
        oc, os = forecast[i, step, 4], forecast[i, step, 5]
        dx, dy = x - forecast[i, step, 0], y - forecast[i, step, 1]
        along = dx * oc + dy * os
        if along <= 0.0:
            return False
        if along <= STEP_S * forecast[i, step, 3]:
            return bool(abs(dy * oc - dx * os) < _NOTICED_M and c * oc + s * os > _FOLLOWS_COSINE)
    return False


@entry
def rollouts(
    path: Floats2, s0: float, v0: float, size: Floats1, forecast: Floats3, actors: Floats2, leads: Ints1,
    plans: Floats2, limits: Floats1, junctions: Floats2, stop_s: float, margins: Floats1, yields_mps2: float,
    steps: int,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return (seconds until trouble, metres driven until then) for each plan; without trouble the whole horizon.

    `path` is (n, 5) x, y, yaw, cosine and sine of yaw, about one row a metre. `forecast` comes from `tracks.tracks`, of
    which the first `steps` count. `actors` are `Traffic.boxes`. `plans` (m, 3) accelerate at [0] for [1] seconds, then
    at [2]. `limits` is the speed limit of each row. `margins` are metres added to the ego's length and width, and
    seconds by which crossing actors may come earlier or later. Trouble is an overlap of two boxes, the front bumper
    beyond row `stop_s`, or an end within one of the `junctions` (first row, last row) before which the ego could have
    waited. Only followers of the ego are expected to brake for the ego, at `yields_mps2`.
    """
    half, last = 0.5 * size[0], len(path) - 2.0
    found, driven = np.full(len(plans), steps * STEP_S), np.zeros(len(plans))
    fastest = v0
    for k in range(int(min(max(s0, 0.0), len(limits) - 1.0)), len(limits)):
        fastest = max(fastest, limits[k])
    near = _near(path, s0, min(fastest, v0 + 5.0 * steps * STEP_S) * steps * STEP_S, forecast, actors, steps)
    others = np.empty((len(near), 7))
    k = int(min(max(s0, 0.0), last))
    x = path[k, 0] + (s0 - k) * (path[k + 1, 0] - path[k, 0])
    y = path[k, 1] + (s0 - k) * (path[k + 1, 1] - path[k, 1])
    for j in range(len(near)):
        i = near[j]
        length, width = actors[i, box.LENGTH], actors[i, box.WIDTH]
        # an actor that is within the margins already cannot be kept out of the margins
        close = _touch(
            forecast[i, 0, 0] - x, forecast[i, 0, 1] - y, path[k, 3], path[k, 4], size[0] + margins[0],
            size[1] + margins[1], forecast[i, 0, 4], forecast[i, 0, 5], length, width,
        )  # fmt: skip
        others[j, _LENGTH], others[j, _WIDTH], others[j, _LEADS] = length, width, float(leads[i])
        others[j, _CLOSE] = 1.0 if close else 0.0
        follows = width > _BICYCLE_WIDTH_M and _leads_over(forecast, i, steps, x, y, path[k, 3], path[k, 4])
        others[j, _FOLLOWS] = 1.0 if follows else 0.0
    for p in range(len(plans)):
        s, v = s0, v0
        for j in range(len(near)):
            others[j, _CLOCK], others[j, _SPEED] = 0.0, forecast[near[j], 0, 3]
        for step in range(1, steps + 1):
            accel = plans[p, 0] if step * STEP_S <= plans[p, 1] + 1e-9 else plans[p, 2]
            if step == 1 and accel > 0.0:
                accel *= _DRIVE_LAG
            after = _ego_speed(v, accel, limits[int(min(max(s, 0.0), len(limits) - 1.0))])
            s += 0.5 * (v + after) * STEP_S
            v = after
            k = int(min(max(s, 0.0), last))
            x = path[k, 0] + (s - k) * (path[k + 1, 0] - path[k, 0])
            y = path[k, 1] + (s - k) * (path[k + 1, 1] - path[k, 1])
            trouble = s + half > stop_s
            for j in range(len(near)):
                if trouble:
                    break
                trouble = _hits(
                    x, y, path[k, 3], path[k, 4], v, step, forecast, near[j], steps, others, j, size, margins,
                    yields_mps2,
                )  # fmt: skip
            if trouble:
                found[p] = (step - 1) * STEP_S
                break
        driven[p] = s - s0
        if found[p] >= steps * STEP_S - 1e-9 and not _stays_out(s0, s, v0, half, junctions):
            found[p] = 0.1
    return found, driven
