"""Lines in equal steps: where the points of a polyline lie, and how it heads there. Compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic.compiled import atan2, hypot
from pytest_drive_robust.jit.arrays import Floats2
from pytest_drive_robust.jit.kernels import entry, inner

__all__ = ["equal_steps"]

Floats = NDArray[np.float64]

_NEAREST_M = 1e-6
"""A point this near to the one before it is left out."""
_TURN = 2.0 * np.pi


@inner
def _unwrapped(angle: float, before: float) -> float:
    """Return what to add to `angle` so that it is at most half a turn from `before`; both from -pi to pi."""
    turned = angle - before
    if abs(turned) < np.pi:
        return 0.0
    rest = turned + np.pi
    if rest < 0.0:
        rest += _TURN
    elif rest >= _TURN:
        rest -= _TURN
    rest -= np.pi
    if rest == -np.pi and turned > 0.0:
        rest = np.pi
    return float(rest - turned)


@entry
def equal_steps(points: Floats2, step_m: float) -> Floats2:
    """Return the line through `points` (n, 2), n >= 1, in equal steps of about `step_m`: (m, 3) x, y, heading.

    Headings are of central differences and do not jump by whole turns.
    """
    corners, s = np.empty((len(points), 2)), np.empty(len(points))
    corners[0, 0], corners[0, 1], s[0] = points[0, 0], points[0, 1], 0.0
    kept = 1
    for k in range(1, len(points)):
        x, y = points[k, 0], points[k, 1]
        if hypot(x - points[k - 1, 0], y - points[k - 1, 1]) > _NEAREST_M:
            s[kept] = s[kept - 1] + hypot(x - corners[kept - 1, 0], y - corners[kept - 1, 1])
            corners[kept, 0], corners[kept, 1] = x, y
            kept += 1
    length_m = s[kept - 1]
    count = max(2, round(length_m / step_m) + 1)
    line, step, before = np.empty((count, 3)), length_m / (count - 1), 0
    for k in range(count):
        at = k * step
        while before < kept - 2 and s[before + 1] <= at:
            before += 1
        for axis in range(2):
            if k == count - 1 or at >= length_m:
                line[k, axis] = corners[kept - 1, axis]
            elif k == 0:
                line[k, axis] = corners[0, axis]
            else:
                first, second = corners[before, axis], corners[before + 1, axis]
                line[k, axis] = (second - first) / (s[before + 1] - s[before]) * (at - s[before]) + first
    last, added = 0.0, 0.0
    for k in range(count):
        a, b = max(k - 1, 0), min(k + 1, count - 1)
        steps = float(b - a)
        angle = atan2((line[b, 1] - line[a, 1]) / steps, (line[b, 0] - line[a, 0]) / steps)
        if k > 0:
            added += _unwrapped(angle, last)
        line[k, 2], last = angle + added, angle
    return line
