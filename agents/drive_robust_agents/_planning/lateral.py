"""Lateral profiles: metres to the right of the route at each row, and the paths that they make.

A profile is an (n,) array. A manoeuvre is a profile; where the ego is not on it, the path leads back smoothly.
"""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning.control import Floats
from drive_robust_agents._planning.static_scene import StaticScene

__all__ = ["blend", "line_of", "path_of", "shift_length_m"]

_BEND_PER_M, _LATERAL_MPS2 = 0.23, 2.5
"""The narrowest turn of the ego, as a curvature, and what passengers bear."""
_SWING_RADIUS_M = 5.2
_SWING_FROM_M, _SWING_BELOW_MPS = 1.2, 4.0


def blend(rows: Floats, start: float, end: float) -> Floats:
    """Return 0 before `start`, 1 after `end`, smooth between."""
    t = np.clip((rows - start) / max(end - start, 1e-6), 0.0, 1.0)
    smooth: Floats = t * t * (3.0 - 2.0 * t)
    return smooth


def _swing(rows: Floats, start: float, sideways_m: float) -> Floats:
    """Return 0 to 1 as `blend`, on two arcs of the narrowest circle that the ego can drive: out of a parking space."""
    radius = max(_SWING_RADIUS_M, 0.5 * sideways_m)
    half = math.sqrt(radius**2 - (radius - 0.5 * sideways_m) ** 2)
    x = np.clip(rows - start, 0.0, 2.0 * half)
    out = radius - np.sqrt(np.maximum(radius**2 - np.minimum(x, half) ** 2, 0.0))
    back = radius - np.sqrt(np.maximum(radius**2 - (2.0 * half - np.maximum(x, half)) ** 2, 0.0))
    found: Floats = np.where(x <= half, out, sideways_m - back) / sideways_m
    return found


def shift_length_m(speed_mps: float, sideways_m: float) -> float:
    """Return the metres that a smooth shift takes: turning circle at low speed, lateral acceleration at high speed."""
    return max(math.sqrt(6.0 * abs(sideways_m) / _BEND_PER_M), speed_mps * math.sqrt(2.4 * abs(sideways_m)), 4.0)


def path_of(
    scene: StaticScene, profile: Floats, row: float, right_m: float, *, speed_mps: float, drift: float = 0.0
) -> Floats:
    """Return (n, 3) x, y, yaw: from where the ego is onto the profile, then along it.

    `drift` is the metres to the right that the ego's heading gains in a metre of the route.
    """
    return line_of(scene, _return(scene, profile, row, right_m, speed_mps=speed_mps, drift=drift))


def line_of(scene: StaticScene, offsets: Floats) -> Floats:
    """Return (n, 3) x, y, yaw: the line that runs so many metres to the right of the route."""
    route, found = scene.route, np.empty((scene.count, 3))
    found[:, 0] = route[:, 0] - offsets * scene.sines
    found[:, 1] = route[:, 1] + offsets * scene.cosines
    slopes = np.empty(scene.count)
    slopes[:-1] = offsets[1:] - offsets[:-1]
    slopes[-1] = 0.0
    found[:, 2] = route[:, 2] + np.arctan(slopes)
    return found


def _return(
    scene: StaticScene, profile: Floats, row: float, right_m: float, *, speed_mps: float, drift: float
) -> Floats:
    """Return the profile with a smooth way onto it.

    The way runs on arcs out of a parking space, else on a cubic that fits the heading.
    """
    here = int(min(max(row, 0.0), scene.count - 2.0))
    slope = float(profile[here + 1] - profile[here])
    away = right_m - float(profile[here] + (row - here) * slope)
    lean = drift - slope
    if abs(away) < 0.02 and abs(lean) < 0.02:
        return profile
    if abs(away) > _SWING_FROM_M and speed_mps < _SWING_BELOW_MPS and abs(lean) < 0.1:
        return profile + away * (1.0 - _swing(scene.rows, row, abs(away)))
    bend = min(_BEND_PER_M, _LATERAL_MPS2 / max(speed_mps, 1.0) ** 2)
    closing = -lean * math.copysign(1.0, away)  # positive: the ego is on its way back already
    length = (-4.0 * closing + math.sqrt(16.0 * closing**2 + 24.0 * bend * abs(away))) / (2.0 * bend)
    length = max(length, 0.9 * speed_mps, 4.0)
    t = np.clip((scene.rows - row) / length, 0.0, 1.0)
    found: Floats = profile + (1.0 - t) ** 2 * (away * (1.0 + 2.0 * t) + length * lean * t)
    return found
