"""Lateral profiles, metres to the right of the route at each row, and the paths of these profiles.

A profile is an (n,) array. A manoeuvre is a profile; from an ego beside the profile, the path leads back smoothly.
"""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning.static_scene import StaticScene
from pytest_drive_robust.arithmetic.compiled import atan
from pytest_drive_robust.jit.arrays import Floats, Floats1, Floats2
from pytest_drive_robust.jit.kernels import entry

__all__ = ["blend", "line_of", "path_of", "shift_length_m"]

_BEND_PER_M, _LATERAL_MPS2 = 0.23, 2.5
"""Greatest curvature of the ego's turns, and greatest lateral acceleration for passengers."""
_SWING_RADIUS_M = 5.2
_ON_IT, _CUBIC, _SWING = range(3)
"""The way onto a profile: none, because the ego is on the profile; a cubic; two arcs."""
_SWING_FROM_M, _SWING_BELOW_MPS = 1.2, 4.0


def blend(rows: Floats, start: float, end: float) -> Floats:
    """Return 0 before `start`, 1 after `end`, smooth between."""
    t = np.clip((rows - start) / max(end - start, 1e-6), 0.0, 1.0)
    smooth: Floats = t * t * (3.0 - 2.0 * t)
    return smooth


def shift_length_m(speed_mps: float, sideways_m: float) -> float:
    """Return the metres that a smooth shift takes: turning circle at low speed, lateral acceleration at high speed."""
    return max(math.sqrt(6.0 * abs(sideways_m) / _BEND_PER_M), speed_mps * math.sqrt(2.4 * abs(sideways_m)), 4.0)


def path_of(
    scene: StaticScene, profile: Floats, row: float, right_m: float, *, speed_mps: float, drift: float = 0.0
) -> Floats:
    """Return the path from the ego onto the profile, then along it: (n, 5) x, y, yaw, cosine and sine of yaw.

    The way onto the profile uses arcs out of a parking space, else a cubic that fits the heading. `drift` is the metres
    to the right that the ego's heading gains per metre of the route.
    """
    here = int(min(max(row, 0.0), scene.count - 2.0))
    slope = float(profile[here + 1] - profile[here])
    away = right_m - float(profile[here] + (row - here) * slope)
    lean = drift - slope
    if abs(away) < 0.02 and abs(lean) < 0.02:
        return line_of(scene, profile)
    if abs(away) > _SWING_FROM_M and speed_mps < _SWING_BELOW_MPS and abs(lean) < 0.1:
        return _lay(scene.route, scene.cosines, scene.sines, profile, _SWING, row, away, 0.0, 1.0)
    bend = min(_BEND_PER_M, _LATERAL_MPS2 / (max(speed_mps, 1.0) * max(speed_mps, 1.0)))
    closing = -lean * math.copysign(1.0, away)  # positive: the ego already heads back
    length = (-4.0 * closing + math.sqrt(16.0 * closing * closing + 24.0 * bend * abs(away))) / (2.0 * bend)
    length = max(length, 0.9 * speed_mps, 4.0)
    return _lay(scene.route, scene.cosines, scene.sines, profile, _CUBIC, row, away, lean, length)


def line_of(scene: StaticScene, profile: Floats) -> Floats:
    """Return the line of a profile, (n, 5) as `path_of`."""
    return _lay(scene.route, scene.cosines, scene.sines, profile, _ON_IT, 0.0, 0.0, 0.0, 1.0)


@entry
def _lay(
    route: Floats2, cosines: Floats1, sines: Floats1, profile: Floats1, way: int, row: float, away: float, lean: float,
    length: float,
) -> Floats:  # fmt: skip
    """Return the line of a profile with the way onto it from `row`, which reduces `away` metres and `lean` to 0.

    A cubic takes `length` metres. Two arcs of the narrowest circle (out of a parking space) reach the middle of the
    lane in twice `half` metres.
    """
    aside = abs(away)
    radius = max(_SWING_RADIUS_M, 0.5 * aside)
    half = math.sqrt(radius * radius - (radius - 0.5 * aside) * (radius - 0.5 * aside))
    found = np.empty((len(route), 5))
    before = 0.0
    for k in range(len(route)):
        offset = profile[k]
        if way == _CUBIC:
            t = min(max((k - row) / length, 0.0), 1.0)
            offset += (1.0 - t) * (1.0 - t) * (away * (1.0 + 2.0 * t) + length * lean * t)
        elif way == _SWING:
            x = min(max(k - row, 0.0), 2.0 * half)
            arc = x if x <= half else 2.0 * half - x
            moved = radius - math.sqrt(max(radius * radius - arc * arc, 0.0))
            offset += away * (1.0 - (moved if x <= half else aside - moved) / aside)
        c, s = cosines[k], sines[k]
        found[k, 0], found[k, 1] = route[k, 0] - offset * s, route[k, 1] + offset * c
        found[k, 2], found[k, 3], found[k, 4] = route[k, 2], c, s
        if k > 0 and offset != before:
            slope = offset - before
            size = math.sqrt(1.0 + slope * slope)
            c, s = cosines[k - 1], sines[k - 1]
            found[k - 1, 2] += atan(slope)
            found[k - 1, 3], found[k - 1, 4] = (c - s * slope) / size, (s + c * slope) / size
        before = offset
    return found
