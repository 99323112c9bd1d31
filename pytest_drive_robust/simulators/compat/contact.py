"""Collisions: separating axes with a look-ahead of one step, and the push that highway-env gives to both bodies."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.arithmetic import Machine, dot2, turn2
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import inline_part, part

__all__ = ["collide"]


@part
def _polygon(arrays: Arrays, body: int) -> c.Floats:
    """(5, 2): the corners of a body, the first one twice."""
    mine, machine = arrays.bodies[body], arrays.machine
    long, wide = mine[c.P_LENGTH] / 2, mine[c.P_WIDTH] / 2
    points = np.empty((5, 2))
    for k in range(5):
        ahead = long if k in (2, 3) else -long
        right = wide if k in (1, 2) else -wide
        points[k, 0] = turn2(machine, mine[c.B_COS], -mine[c.B_SIN], ahead, right) + mine[c.B_X]
        points[k, 1] = turn2(machine, mine[c.B_SIN], mine[c.B_COS], ahead, right) + mine[c.B_Y]
    return points


@part
def _project(machine: Machine, polygon: c.Floats, nx: float, ny: float) -> tuple[float, float]:
    low, high = math.inf, -math.inf
    for k in range(5):
        value = dot2(machine, polygon[k, 0], polygon[k, 1], nx, ny)
        low, high = min(low, value), max(high, value)
    return low, high


@part
def _between(low_a: float, high_a: float, low_b: float, high_b: float) -> float:
    """Distance of two intervals, negative when they overlap."""
    return low_b - high_a if low_a < low_b else low_a - high_b


@part
def _centre(polygon: c.Floats, axis: int) -> float:
    return float((polygon[0, axis] + polygon[1, axis] + polygon[2, axis] + polygon[3, axis]) / 4)


@part
def _separate(
    machine: Machine, a: c.Floats, b: c.Floats, moves_x: float, moves_y: float
) -> tuple[bool, bool, float, float]:
    """(overlap now, overlap after the relative move of `a`, translation that takes `a` out of `b`)."""
    now = then = True
    least, out_x, out_y = math.inf, 0.0, 0.0
    away_x, away_y = _centre(a, 0) - _centre(b, 0), _centre(a, 1) - _centre(b, 1)
    for side in range(8):
        edges, k = (a, side) if side < 4 else (b, side - 4)
        nx, ny = -edges[k + 1, 1] + edges[k, 1], edges[k + 1, 0] - edges[k, 0]
        size = math.sqrt(dot2(machine, nx, ny, nx, ny))
        nx, ny = nx / size, ny / size
        low_a, high_a = _project(machine, a, nx, ny)
        low_b, high_b = _project(machine, b, nx, ny)
        if _between(low_a, high_a, low_b, high_b) > 0:
            now = False
        shift = dot2(machine, nx, ny, moves_x, moves_y)
        if shift < 0:
            low_a += shift
        else:
            high_a += shift
        apart = _between(low_a, high_a, low_b, high_b)
        if apart > 0:
            then = False
        if not now and not then:
            break  # both stay false, and nothing is pushed
        if abs(apart) < least:
            least = abs(apart)
            sign = 1.0 if dot2(machine, away_x, away_y, nx, ny) > 0 else -1.0
            out_x, out_y = sign * nx, sign * ny
    return now, then, least * out_x, least * out_y


@part
def _push(arrays: Arrays, body: int, x: float, y: float) -> None:
    arrays.bodies[body, c.B_IMPACT_X], arrays.bodies[body, c.B_IMPACT_Y] = x, y
    arrays.body_ints[body, c.I_HAS_IMPACT] = 1


@part
def _touch(arrays: Arrays, body: int, other: int, dt_s: float) -> None:
    """The two boxes against each other, and what follows from it."""
    mine, theirs, one, two = arrays.body_ints[body], arrays.body_ints[other], arrays.bodies[body], arrays.bodies[other]
    now, then, x, y = _separate(
        arrays.machine,
        _polygon(arrays, body),
        _polygon(arrays, other),
        one[c.B_SPEED] * one[c.B_COS] * dt_s - two[c.B_SPEED] * two[c.B_COS] * dt_s,
        one[c.B_SPEED] * one[c.B_SIN] * dt_s - two[c.B_SPEED] * two[c.B_SIN] * dt_s,
    )
    solid = mine[c.I_SOLID] and theirs[c.I_SOLID]
    if then and solid:
        if theirs[c.I_KIND] == c.OBSTACLE:
            _push(arrays, body, x, y)
        else:
            _push(arrays, body, x / 2, y / 2)
            _push(arrays, other, -x / 2, -y / 2)
    if now and solid:
        mine[c.I_CRASHED] = theirs[c.I_CRASHED] = 1
    if now and not mine[c.I_SOLID]:
        mine[c.I_HIT] = 1
    if now and not theirs[c.I_SOLID]:
        theirs[c.I_HIT] = 1


@inline_part
def collide(arrays: Arrays, body: int, other: int, dt_s: float) -> None:
    """Crash two bodies that overlap, and push apart two that will; a body that is not solid is only hit."""
    bodies, ints = arrays.bodies, arrays.body_ints
    dx, dy = bodies[other, c.B_X] - bodies[body, c.B_X], bodies[other, c.B_Y] - bodies[body, c.B_Y]
    reach = (arrays.bodies[body, c.P_DIAGONAL] + arrays.bodies[other, c.P_DIAGONAL]) / 2
    reach += bodies[body, c.B_SPEED] * dt_s
    # the first two only save the root: it is never rounded below |dx| or |dy|
    if abs(dx) > reach or abs(dy) > reach or math.sqrt(dot2(arrays.machine, dx, dy, dx, dy)) > reach:
        return
    if not (ints[body, c.I_COLLIDABLE] and ints[other, c.I_COLLIDABLE]):
        return
    if ints[body, c.I_CHECKS] or ints[other, c.I_CHECKS]:
        _touch(arrays, body, other, dt_s)
