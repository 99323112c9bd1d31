"""Curves for roads that follow a given line: smoothed, prolonged, moved sideways, joined.

Lines are (n, 3): x, y in metres, heading in radians, points about a metre apart. A pose is one row of a line.
"""

from __future__ import annotations

import math
from math import fsum

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.signals import mean, moving_sum
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import Pose, arc_lengths, moved, resample, seen_from

_SIGMA_M = 4.0
_REACH_M = 12
_FIT_M = 10.0


def smoothed(points: Floats) -> Floats:
    """Return a line through points (n, 2) without their rounding: a Gaussian of 4 m along it."""
    line = resample(points)
    first, last = _end_heading(line), _end_heading(line[::-1]) + math.pi
    steps = np.arange(1, _REACH_M + 1)[:, None]
    before = line[0, :2] - steps[::-1] * [scalars.cos(first), scalars.sin(first)]
    after = line[-1, :2] + steps * [scalars.cos(last), scalars.sin(last)]
    padded = np.concatenate([before, line[:, :2], after])
    away = np.arange(-_REACH_M, _REACH_M + 1) / _SIGMA_M
    weights = arrays.exp(-0.5 * (away * away))
    return resample(moving_sum(padded.T, weights / fsum(weights)).T)


def _end_heading(line: Floats) -> float:
    """Return the heading of the straight line that fits the first metres best."""
    near = line[arc_lengths(line) <= _FIT_M, :2]
    if len(near) < 3:
        near = line[:3, :2]
    x, y = near[:, 0] - mean(near[:, 0]), near[:, 1] - mean(near[:, 1])
    heading = 0.5 * scalars.atan2(2.0 * fsum(x * y), fsum(x * x - y * y))
    (dx, dy), (cos, sin) = near[-1] - near[0], (scalars.cos(heading), scalars.sin(heading))
    return heading if dx * cos + dy * sin >= 0.0 else heading + math.pi


def straight(pose: Pose, length_m: float) -> Floats:
    """Return a straight line that begins at `pose`."""
    x, y, heading = pose
    at = np.linspace(0.0, length_m, max(2, round(length_m) + 1))
    return np.column_stack([x + at * scalars.cos(heading), y + at * scalars.sin(heading), np.full(len(at), heading)])


def prolonged(line: Floats, *, before_m: float = 0.0, after_m: float = 0.0) -> Floats:
    """Return the line with `before_m` and `after_m` straight metres added at its ends."""
    parts = [line]
    if before_m > 0.5:
        parts.insert(0, straight(moved(tuple(line[0]), -before_m), before_m)[:-1])
    if after_m > 0.5:
        parts.append(straight(tuple(line[-1]), after_m)[1:])
    return joined(*parts)


def joined(*lines: Floats) -> Floats:
    """Return one line through several that follow each other."""
    return resample(np.concatenate(lines))


def shifted(line: Floats, right_m: float | Floats) -> Floats:
    """Return the line moved right by `right_m`, a number or (n,) metres per point; keeps the number of points."""
    right = np.asarray(right_m, dtype=float)
    x = line[:, 0] - right * arrays.sin(line[:, 2])
    y = line[:, 1] + right * arrays.cos(line[:, 2])
    if right.ndim == 0:
        return np.column_stack([x, y, line[:, 2]])
    heading = np.unwrap(arrays.atan2(np.gradient(y), np.gradient(x)))
    return np.column_stack([x, y, heading])


def reversed_line(line: Floats) -> Floats:
    """Return the line driven from its end to its start."""
    return np.asarray(line[::-1] + np.array([0.0, 0.0, math.pi]))


def bridge(start: Pose, end: Pose) -> Floats:
    """Return a smooth line from one pose to another: nearly an arc where one fits."""
    a, b = np.array(start[:2]), np.array(end[:2])
    turn = abs(math.remainder(end[2] - start[2], math.tau))
    reach = scalars.hypot(*(b - a))
    share = 1.0 / 3.0 if turn < 0.02 else 4.0 / 3.0 * scalars.tan(turn / 4.0) / (2.0 * scalars.sin(turn / 2.0))
    first = last = min(share, 0.7) * reach
    corner = crossing_point(start, end)
    if corner is not None and turn > 0.5 and corner[0] > 1.0 and corner[1] > 1.0:
        factor = 4.0 / 3.0 * scalars.tan(turn / 4.0) / scalars.tan(turn / 2.0)
        first, last = factor * corner[0], factor * corner[1]
    control_a = a + first * np.array([scalars.cos(start[2]), scalars.sin(start[2])])
    control_b = b - last * np.array([scalars.cos(end[2]), scalars.sin(end[2])])
    t = np.linspace(0.0, 1.0, max(30, round(2.0 * reach)))[:, None]
    s = 1.0 - t
    points = s * s * s * a + 3.0 * s * s * t * control_a + 3.0 * s * t * t * control_b + t * t * t * b
    line = resample(points)
    line[0, 2], line[-1, 2] = start[2], start[2] + math.remainder(end[2] - start[2], math.tau)
    return line


def crossing_point(start: Pose, end: Pose) -> tuple[float, float] | None:
    """Return (metres ahead of `start`, metres before `end`) of the corner of their straight ways, None if parallel."""
    ahead, right = seen_from(start, end)
    turn = end[2] - start[2]
    if abs(scalars.sin(turn)) < 0.05:
        return None
    before_end = right / scalars.sin(turn)
    return ahead - before_end * scalars.cos(turn), before_end
