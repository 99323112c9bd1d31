"""Lateral profiles: metres to the right of the route at each row, and the paths that they make.

A profile is an (n,) array. A manoeuvre is a profile; where the ego is not on it, the path leads back smoothly.
"""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning.control import Floats
from drive_robust_agents._planning.scene import Scene

__all__ = ["blend", "path_of", "shift_length_m"]


def blend(rows: Floats, start: float, end: float) -> Floats:
    """0 before `start`, 1 after `end`, smooth between."""
    t = np.clip((rows - start) / max(end - start, 1e-6), 0.0, 1.0)
    smooth: Floats = t * t * (3.0 - 2.0 * t)
    return smooth


def shift_length_m(speed_mps: float, sideways_m: float) -> float:
    """Metres that a smooth shift takes: turning circle at low speed, lateral acceleration at high speed."""
    return max(2.0 + math.sqrt(24.0 * abs(sideways_m)), speed_mps * math.sqrt(2.4 * abs(sideways_m)))


def path_of(scene: Scene, profile: Floats, row: float, right_m: float, *, speed_mps: float) -> Floats:
    """(n, 3) x, y, yaw: from where the ego is onto the profile, then along it."""
    away = right_m - float(np.interp(row, scene.rows, profile))
    offsets = profile
    if abs(away) > 0.02:
        back = max(8.0, 1.2 * speed_mps, 4.0 * abs(away))
        offsets = profile + away * (1.0 - blend(scene.rows, row, row + back))
    route, found = scene.route, np.empty((scene.count, 3))
    found[:, 0] = route[:, 0] - offsets * scene.sines
    found[:, 1] = route[:, 1] + offsets * scene.cosines
    slopes = np.empty(scene.count)
    slopes[:-1] = offsets[1:] - offsets[:-1]
    slopes[-1] = 0.0
    found[:, 2] = route[:, 2] + np.arctan(slopes)
    return found
