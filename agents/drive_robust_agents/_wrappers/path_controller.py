"""Convert SimLingo's path and speed waypoints to controls, and let a vehicle that stands too long creep.

The structure is as published (SimLingo `team_code/agent_simlingo.py`, `config_simlingo.py`): the path steers, the speed
waypoints drive, independently of each other. See `tuning` for gains and limits.

The points of the path are one metre apart, the speed waypoints 0.25 s apart; the first of either is one step ahead.
Points are (forward, right) metres in the frame of the vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drive_robust_agents._wrappers.pid import Gains, Point, WindowedPid, turn_of
from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic import scalars

__all__ = ["Creep", "PathController", "PathTuning", "along"]

_STEP_S = 0.25
"""Seconds between consecutive speed waypoints."""


@dataclass(frozen=True, slots=True)
class PathTuning:
    """Every number of a `PathController`.

    The look-ahead is `look_s` seconds plus `look_m` metres, clipped to `least_look_m`..`most_look_m`. `turn` acts on an
    angle in units of 90 degrees, `speed` on metres per second. The wanted speed is the speed between the waypoints
    `speed_from` and `speed_to`, counted from 0. The brake is full below a wanted speed of `brake_below_mps`, and above
    `brake_ratio` times the wanted speed; at most `most_missing_mps` of the missing speed count.
    """

    turn: Gains
    speed: Gains
    look_s: float
    look_m: float
    least_look_m: float
    most_look_m: float
    speed_from: int
    speed_to: int
    brake_below_mps: float
    brake_ratio: float
    most_missing_mps: float


class PathController:
    """Steers for a point of the path whose distance grows with the speed; accelerates or brakes by the waypoints.

    Path and waypoints know nothing of each other. One object per episode.
    """

    def __init__(self, tuning: PathTuning) -> None:
        self.tuning = tuning
        self._turn, self._speed = WindowedPid(tuning.turn), WindowedPid(tuning.speed)

    def step(self, path: Sequence[Point], speed_points: Sequence[Point], speed_mps: float) -> Control:
        """Return the control for this tick, from at least one point of a path and `speed_to` + 1 waypoints."""
        tuning = self.tuning
        (x0, y0), (x1, y1) = speed_points[tuning.speed_from], speed_points[tuning.speed_to]
        desired = scalars.hypot(x1 - x0, y1 - y0) / (_STEP_S * (tuning.speed_to - tuning.speed_from))
        brake = desired < tuning.brake_below_mps or speed_mps / desired > tuning.brake_ratio
        missing = min(max(desired - speed_mps, 0.0), tuning.most_missing_mps)
        throttle = min(max(self._speed.step(missing), 0.0), 1.0)
        look = min(max(tuning.look_s * speed_mps + tuning.look_m, tuning.least_look_m), tuning.most_look_m)
        steer = min(max(self._turn.step(turn_of(along(path, look))), -1.0), 1.0)
        return Control(0.0 if brake else throttle, steer, 1.0 if brake else 0.0)


class Creep:
    """Makes the vehicle roll for a moment after a long stop, which frees an agent that waits without a reason.

    Published: after more than 800 ticks below 0.1 m/s, throttle 0.4 until the measured speed is higher, and for 15
    ticks then.
    """

    AFTER_TICKS, FOR_TICKS, THROTTLE, STANDS_MPS = 800, 15, 0.4, 0.1

    def __init__(self) -> None:
        self._stood, self._left = 0, 0

    def step(self, speed_mps: float) -> bool:
        """Return whether to drive this tick with `THROTTLE` and without brake; call once a tick."""
        self._stood = self._stood + 1 if speed_mps < self.STANDS_MPS else 0
        if self._stood > self.AFTER_TICKS:
            self._left = self.FOR_TICKS
        creeps = self._left > 0
        self._left -= creeps
        return creeps


def along(path: Sequence[Point], distance_m: float) -> Point:
    """Return the point `distance_m` along a path that begins at the vehicle; the last point of a shorter path.

    >>> along([(1.0, 0.0), (2.0, 0.0), (2.0, 1.0)], 2.25)
    (2.0, 0.25)
    """
    x, y, left = 0.0, 0.0, distance_m
    for next_x, next_y in path:
        step = scalars.hypot(next_x - x, next_y - y)
        if step >= left > 0.0:
            share = left / step
            return x + share * (next_x - x), y + share * (next_y - y)
        x, y, left = next_x, next_y, left - step
    return x, y
