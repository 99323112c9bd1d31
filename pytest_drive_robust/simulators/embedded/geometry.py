"""Polylines: (n, 3) arrays of x, y in metres and heading in radians, points about one metre apart."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.compiled import atan2, hypot
from pytest_drive_robust.jit.arrays import Floats, Floats2
from pytest_drive_robust.jit.kernels import entry, inner

Pose = tuple[float, float, float]
"""x and y in metres, heading in radians, clockwise (y points down, as in CARLA)."""

_NEAREST_M = 1e-6
"""Least distance from the point before; nearer points are left out."""
_TURN = 2.0 * np.pi


def arc_lengths(points: Floats) -> Floats:
    """Return the distance along the line of each point, (n,)."""
    steps = arrays.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
    return np.concatenate([[0.0], np.cumsum(steps)])


def resample(points: Floats, *, step_m: float = 1.0) -> Floats:
    """Return the line through `points` (n, >=2) in equal steps of about `step_m`: (m, 3) x, y, heading.

    Headings are of central differences. Raises `ValueError` for no points.
    """
    xy = np.array(np.asarray(points)[:, :2], np.float64, order="C")
    if not len(xy):
        raise ValueError("a line has at least one point, got none")
    return equal_steps(xy, step_m)


def place(line: Floats, s_m: float, right_m: float = 0.0) -> tuple[float, float, float]:
    """Return x, y, heading at `s_m` along the line, `right_m` to its right; the line goes straight on past its ends."""
    step = arc_lengths(line)[-1] / (len(line) - 1)
    index = int(np.clip(np.floor(s_m / step), 0, len(line) - 2))
    share = s_m / step - index
    x, y = line[index, :2] + share * (line[index + 1, :2] - line[index, :2])
    heading = float(line[index, 2] + np.clip(share, 0.0, 1.0) * (line[index + 1, 2] - line[index, 2]))
    cos, sin = scalars.cos_sin(heading)
    return float(x - right_m * sin), float(y + right_m * cos), heading


def moved(pose: Pose, ahead_m: float, right_m: float = 0.0) -> Pose:
    """Return the pose moved `ahead_m` ahead and `right_m` to the right, with its heading."""
    x, y, heading = pose
    cos, sin = scalars.cos_sin(heading)
    return x + ahead_m * cos - right_m * sin, y + ahead_m * sin + right_m * cos, heading


def seen_from(pose: Pose, point: Floats | tuple[float, ...]) -> tuple[float, float]:
    """Return (metres ahead, metres to the right) of a point (x, y, ...) as seen from a pose: the inverse of `moved`."""
    dx, dy = float(point[0]) - pose[0], float(point[1]) - pose[1]
    cos, sin = scalars.cos_sin(pose[2])
    return dx * cos + dy * sin, dy * cos - dx * sin


def project(line: Floats, x_m: float, y_m: float) -> tuple[float, float]:
    """Return (metres along the line, metres to its right) of the place (x, y)."""
    away = arrays.hypot(line[:, 0] - x_m, line[:, 1] - y_m)
    index = int(np.argmin(away))
    step = arc_lengths(line)[-1] / (len(line) - 1)
    dx, dy = x_m - line[index, 0], y_m - line[index, 1]
    cos, sin = scalars.cos_sin(line[index, 2])
    return float(index * step + dx * cos + dy * sin), float(-dx * sin + dy * cos)


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
