"""Polylines: (n, 3) arrays of x, y in metres and heading in radians, points about one metre apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.simulators.embedded.kernels.lines import equal_steps

__all__ = ["arc_lengths", "place", "project", "resample"]

Floats = NDArray[np.float64]


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
    """Return x, y, heading of the point `s_m` along the line and `right_m` beside it.

    Beyond the ends it goes straight on.
    """
    step = arc_lengths(line)[-1] / (len(line) - 1)
    index = int(np.clip(np.floor(s_m / step), 0, len(line) - 2))
    share = s_m / step - index
    x, y = line[index, :2] + share * (line[index + 1, :2] - line[index, :2])
    heading = float(line[index, 2] + np.clip(share, 0.0, 1.0) * (line[index + 1, 2] - line[index, 2]))
    cos, sin = scalars.cos_sin(heading)
    return float(x - right_m * sin), float(y + right_m * cos), heading


def project(line: Floats, x_m: float, y_m: float) -> tuple[float, float]:
    """Return (distance along the line, distance to its right) of the point of the line that is nearest to (x, y)."""
    away = arrays.hypot(line[:, 0] - x_m, line[:, 1] - y_m)
    index = int(np.argmin(away))
    step = arc_lengths(line)[-1] / (len(line) - 1)
    dx, dy = x_m - line[index, 0], y_m - line[index, 1]
    cos, sin = scalars.cos_sin(line[index, 2])
    return float(index * step + dx * cos + dy * sin), float(-dx * sin + dy * cos)
