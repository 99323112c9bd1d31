"""Lay a smooth path through the sparse plan, and locate the vehicle on the path by raw GPS."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust import GlobalPlan, RoadOption
from pytest_drive_robust.arithmetic.arrays import hypot
from pytest_drive_robust.arithmetic.scalars import atan2, cos, sin, tan
from pytest_drive_robust.arithmetic.signals import interpolate
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Junction", "PlanPath"]

_STEP_M = 0.5
"""Between two points of the path."""
_WINDOW_M = 12.0
"""The vehicle is searched this far around the last answer, to both sides."""
_TURNS = {RoadOption.LEFT: -math.pi / 2.0, RoadOption.RIGHT: math.pi / 2.0, RoadOption.STRAIGHT: 0.0}
_CHANGES = {RoadOption.CHANGE_LANE_LEFT: 0.0, RoadOption.CHANGE_LANE_RIGHT: 0.0}
_MANOEUVRES = {**_TURNS, **_CHANGES}
"""Turn of the heading by command; before and after the manoeuvre the path follows the road."""


@dataclass(frozen=True, slots=True)
class Junction:
    """Metres along the path where a junction is entered and left, and the command in it."""

    entry_m: float
    exit_m: float
    command: RoadOption


class PlanPath:
    """Cubic pieces through the plan's points, sampled every half metre.

    The plan gives a point and a command at the beginning and at the end of each junction and lane change. On roads the
    plan gives a point every 50 m, so that the path cuts bends by about a metre. `points` is (n, 2) metres. Raises
    `ValueError` for a plan without points.
    """

    def __init__(self, plan: GlobalPlan, start_yaw_rad: float) -> None:
        if not plan.points:
            raise ValueError("the plan has no points, expected at least one: was reset called?")
        knots = np.array([(point.x_m, point.y_m) for point in plan.points], dtype=np.float64).reshape(-1, 2)
        commands = [point.command for point in plan.points]
        headings = _headings(knots, commands, start_yaw_rad)
        pieces, entries, length = [knots[:1]], [0.0], 0.0
        for k in range(len(knots) - 1):
            piece = _hermite(knots[k], knots[k + 1], headings[k], headings[k + 1])
            pieces.append(piece)
            steps = np.diff(np.concatenate((pieces[-2][-1:], piece)), axis=0)
            length += math.fsum(hypot(steps[:, 0], steps[:, 1]).tolist())
            entries.append(length)
        points = np.concatenate(pieces)
        steps = np.diff(points, axis=0)
        along = np.concatenate(([0.0], np.cumsum(hypot(steps[:, 0], steps[:, 1]))))
        stations = np.arange(0.0, max(length, _STEP_M), _STEP_M)
        tail = _STEP_M * np.arange(1, 80)[:, None] * np.array([cos(headings[-1]), sin(headings[-1])])
        sampled = np.column_stack([interpolate(stations, along, points[:, axis]) for axis in (0, 1)])
        self.points: Floats = np.concatenate((sampled, sampled[-1:] + tail))
        self.junctions = tuple(
            Junction(entries[k], entries[k + 1], commands[k]) for k in range(len(knots) - 1) if commands[k] in _TURNS
        )
        self._changes = tuple((entries[k], entries[k + 1]) for k in range(len(knots) - 1) if commands[k] in _CHANGES)
        self._at = 0

    def locate(self, x_m: float, y_m: float) -> float:
        """Return the metres along the path of the nearest point, searched around the last answer."""
        reach = int(_WINDOW_M / _STEP_M)
        first = max(0, self._at - reach)
        near = self.points[first : self._at + reach + 1]
        dx, dy = near[:, 0] - x_m, near[:, 1] - y_m
        away = dx * dx + dy * dy
        self._at = first + int(np.argmin(away))
        return self._at * _STEP_M

    def ahead(self, x_m: float, y_m: float, yaw_rad: float, count: int) -> Floats:
        """Return the path from the located place on, (count, 2) metres (forward, right), one point a metre."""
        stride = int(1.0 / _STEP_M)
        rows = np.minimum(self._at + stride * np.arange(count), len(self.points) - 1)
        dx, dy = self.points[rows, 0] - x_m, self.points[rows, 1] - y_m
        c, s = cos(yaw_rad), sin(yaw_rad)
        return np.column_stack((c * dx + s * dy, c * dy - s * dx))

    def next_junction(self, along_m: float) -> Junction | None:
        """Return the next junction that does not end before `along_m`, or None."""
        return next((junction for junction in self.junctions if along_m < junction.exit_m), None)

    def to_lane_end(self, along_m: float) -> float:
        """Return the metres until the path leaves its lane's markings; negative in a junction or lane change."""
        spans = (*((junction.entry_m, junction.exit_m) for junction in self.junctions), *self._changes)
        return min((start - along_m for start, end in spans if along_m < end), default=math.inf)


def _headings(knots: Floats, commands: list[RoadOption], start_yaw_rad: float) -> list[float]:
    """Return the heading at every point.

    A manoeuvre starts along the road before it and ends along the road after it.
    """
    chords = [atan2(*(knots[k + 1] - knots[k])[::-1]) for k in range(len(knots) - 1)]
    headings = [start_yaw_rad]
    for k in range(1, len(knots) - 1):
        if commands[k] in _MANOEUVRES:
            headings.append(chords[k - 1])
        elif commands[k - 1] in _MANOEUVRES:
            headings.append(chords[k])
        else:
            headings.append(atan2(*(knots[k + 1] - knots[k - 1])[::-1]))
    if chords:
        before = math.remainder(chords[-1] - headings[-1], math.tau)
        in_turn = commands[-2] in _MANOEUVRES
        headings.append(headings[-1] + _MANOEUVRES[commands[-2]] if in_turn else chords[-1] + before)
    return headings


def _hermite(start: Floats, end: Floats, from_rad: float, to_rad: float) -> Floats:
    """Return a cubic from `start` to `end` with these headings, without its first point."""
    chord = float(hypot(*(end - start)))
    turn = abs(math.remainder(to_rad - from_rad, math.tau))
    # the speed with which a cubic follows a circular arc of this turn
    pull = chord if turn < 1e-3 else 4.0 * tan(turn / 4.0) * chord / (2.0 * sin(min(turn, 3.0) / 2.0))
    t = np.linspace(0.0, 1.0, max(3, math.ceil(chord / _STEP_M)))[1:, None]
    leave = pull * np.array([cos(from_rad), sin(from_rad)])
    arrive = pull * np.array([cos(to_rad), sin(to_rad)])
    square = t * t
    cube = square * t
    curve: Floats = (
        (2.0 * cube - 3.0 * square + 1.0) * start
        + (cube - 2.0 * square + t) * leave
        + (3.0 * square - 2.0 * cube) * end
        + (cube - square) * arrive
    )
    return curve
