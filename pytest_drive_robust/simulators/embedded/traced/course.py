"""Read the waypoints of a dense route: lines, the stretches without waypoints (junctions), lane changes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from math import fsum

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.series import wrap_angle
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths
from pytest_drive_robust.simulators.embedded.traced.lines import bridge, joined, smoothed

_GAP_M = 7.0
_LEAST_M, _MOST_M, _FARTHEST_M = 20.0, 5000.0, 1.0e6
_LONGEST_GAP_M = 500.0
_SAME_M = 0.05
_JUMP_RAD, _AFTER_JUMP_RAD = math.radians(15.0), math.radians(12.0)
_LANE_M = (2.4, 4.6)
_NEIGHBOURS = 4


@dataclass(frozen=True, slots=True)
class Shift:
    """A lane change: its middle `at_m` along the line, and the shift to the right in metres."""

    at_m: float
    right_m: float


@dataclass(frozen=True, slots=True)
class RouteCourse:
    """The course of a route: `before` and `after` the main stretch without waypoints; without it, `after` is None.

    `shifts` are the lane changes that were removed from `before`, so that `before` is one lane from end to end.
    """

    before: Floats
    after: Floats | None
    shifts: tuple[Shift, ...]

    @property
    def start_m(self) -> float:
        """Metres from the start of the route to the stretch without waypoints."""
        return float(arc_lengths(self.before)[-1])

    @property
    def gap_m(self) -> float:
        """Straight distance over the stretch without waypoints in metres, 0 without a stretch."""
        return 0.0 if self.after is None else scalars.hypot(*(self.after[0, :2] - self.before[-1, :2]))

    def whole(self) -> Floats:
        """Return the whole course as one line, with a smooth curve where waypoints are missing."""
        if self.after is None:
            return self.before
        between = bridge(tuple(self.before[-1]), tuple(self.after[0]))
        return joined(self.before, between[1:-1], self.after)


def read_course(route: Route) -> RouteCourse:
    """Read the waypoints of a route. Raises `RouteError` (without the route's id) for an impossible road."""
    points = _points(route)
    steps = arrays.hypot(*np.diff(points, axis=0).T)
    # sparse waypoints have mostly long steps, so that a long step does not mean a junction
    gaps = np.flatnonzero(steps > _GAP_M) if np.median(steps) <= _GAP_M else np.array([], dtype=np.int64)
    gaps = gaps[(gaps > 0) & (gaps < len(points) - 2)]
    if len(gaps) == 0:
        straightened, shifts = _without_shifts(points)
        return RouteCourse(smoothed(straightened), None, shifts)
    parts = [smoothed(part) for part in np.split(points, gaps + 1)]
    scores = [_importance(a, b) for a, b in pairwise(parts)]
    main = int(np.argmax(scores))
    return RouteCourse(_chained(parts[: main + 1]), _chained(parts[main + 1 :]), ())


def _points(route: Route) -> Floats:
    points = np.array([[point.x_m, point.y_m] for point in route.waypoints])
    if np.abs(points).max() > _FARTHEST_M:
        raise RouteError(
            f"a waypoint lies {np.abs(points).max():.3g} m from the town's origin, expected 1000 km at most"
        )
    points = points[np.concatenate([[True], arrays.hypot(*np.diff(points, axis=0).T) > _SAME_M])]
    if len(points) < 3:
        raise RouteError(f"{len(points)} waypoint(s) at different places, expected at least 3")
    steps = arrays.hypot(*np.diff(points, axis=0).T)
    if steps.max() > _LONGEST_GAP_M:
        raise RouteError(f"two waypoints that follow each other are {steps.max():.0f} m apart, expected 500 m at most")
    length = fsum(steps)
    if not _LEAST_M <= length <= _MOST_M:
        raise RouteError(f"its waypoints are {length:.0f} m long, expected {_LEAST_M:.0f} to {_MOST_M:.0f} m")
    heading = arrays.atan2(*np.diff(points, axis=0).T[::-1])
    turn = np.abs(wrap_angle(np.diff(heading)))
    if turn.max() > math.radians(120.0):
        k = int(turn.argmax()) + 1
        raise RouteError(
            f"its way turns by {math.degrees(turn.max()):.0f} degrees at waypoint {k + 1} "
            f"({points[k, 0]:.1f}, {points[k, 1]:.1f}), expected 120 at most"
        )
    return np.asarray(points, np.float64)


def _importance(before: Floats, after: Floats) -> float:
    turn = abs(math.remainder(after[0, 2] - before[-1, 2], math.tau))
    return scalars.hypot(*(after[0, :2] - before[-1, :2])) + 0.6 * math.degrees(turn)


def _chained(parts: list[Floats]) -> Floats:
    line = parts[0]
    for part in parts[1:]:
        line = joined(line, bridge(tuple(line[-1]), tuple(part[0]))[1:-1], part)
    return line


def _without_shifts(points: Floats) -> tuple[Floats, tuple[Shift, ...]]:
    """Return the points with every jump to the next lane taken out, and the jumps."""
    steps = np.diff(points, axis=0)
    length = arrays.hypot(*steps.T)
    s = np.concatenate([[0.0], np.cumsum(length)])
    heading = np.unwrap(arrays.atan2(steps[:, 1], steps[:, 0]))
    moved = points.copy()
    shifts: list[Shift] = []
    for k in range(2, len(steps) - 2):
        before = mean(heading[max(0, k - _NEIGHBOURS) : k])
        after = mean(heading[k + 1 : k + 1 + _NEIGHBOURS])
        aside = length[k] * scalars.sin(heading[k] - (before + after) / 2.0)
        jumps = abs(heading[k] - before) > _JUMP_RAD and abs(heading[k] - after) > _JUMP_RAD
        if jumps and abs(after - before) < _AFTER_JUMP_RAD and _LANE_M[0] <= abs(aside) <= _LANE_M[1]:
            middle = (before + after) / 2.0
            moved[k + 1 :] -= aside * np.array([-scalars.sin(middle), scalars.cos(middle)])
            shifts.append(Shift(float(s[k] + length[k] / 2.0), float(aside)))
    return moved, tuple(shifts)
