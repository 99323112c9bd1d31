"""Convert predicted waypoints to controls: the controller of TCP, UniAD and VAD.

The structure is as published (Bench2DriveZoo `TCP/model.py`, `team_code/pid_controller.py`): two windowed PIDs, an aim
among the waypoints, the route's target point as the aim in some cases, and a brake that is on or off. See `tuning` for
gains and limits.

Waypoints and target are (forward, right) metres in the frame of the vehicle. Waypoints are 0.5 s apart, the first
waypoint 0.5 s ahead.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic import scalars

__all__ = [
    "Gains",
    "Point",
    "WaypointController",
    "WaypointTuning",
    "WindowedPid",
    "capped_throttle",
    "published_turn_of",
    "turn_of",
]

Point = tuple[float, float]


class Gains(NamedTuple):
    """Gains of a `WindowedPid`: per unit of error, of its mean over the window, of its change since the last step."""

    p: float
    i: float
    d: float
    window: int


class WindowedPid:
    """A PID whose integral is the mean of the last errors and whose derivative is the last difference of errors.

    The window begins full of zeros, so that the integral of a new episode grows slowly. One object per episode.

    >>> pid = WindowedPid(Gains(p=1.0, i=4.0, d=10.0, window=4))
    >>> pid.step(1.0), pid.step(1.0)
    (12.0, 3.0)
    """

    def __init__(self, gains: Gains) -> None:
        self._gains = gains
        self._errors = deque([0.0] * gains.window, maxlen=gains.window)

    def step(self, error: float) -> float:
        """Return the control for the error of this tick."""
        errors, gains = self._errors, self._gains
        change = error - errors[-1]
        errors.append(error)
        return gains.p * error + gains.i * (sum(errors) / gains.window) + gains.d * change


@dataclass(frozen=True, slots=True)
class WaypointTuning:
    """Every number of a `WaypointController`, and the agent's limits on its pedals, which limit nothing by default.

    `turn` acts on an angle in units of 90 degrees, `speed` on metres per second. `speed_pairs` is the number of pairs
    of waypoints that give the wanted speed. A target overrules the waypoints from a difference of `target_turn` (units
    of 90 degrees) and within `target_within_m`; within `calm_within_m` a target with a smaller angle is preferred.
    `behind_is_right`: see `published_turn_of`. The brake is full below a wanted speed of `brake_below_mps`, and above
    `brake_ratio` times the wanted speed; at most `most_missing_mps` of the missing speed count.

    `cruise_throttle` is the most throttle above `free_mps`, or above `free_turning_mps` with a steering beyond
    `turning`, `free_throttle` the most below; above `coast_above_mps` the throttle is 0. `full_brake`: the agent makes
    any brake a full brake.
    """

    turn: Gains
    speed: Gains
    aim_m: float
    speed_pairs: int
    target_turn: float
    target_within_m: float
    calm_within_m: float
    behind_is_right: bool
    brake_below_mps: float
    brake_ratio: float
    most_missing_mps: float
    most_throttle: float
    cruise_throttle: float = 1.0
    free_throttle: float = 1.0
    free_mps: float = math.inf
    free_turning_mps: float = math.inf
    turning: float = math.inf
    coast_above_mps: float = math.inf
    full_brake: bool = False


class WaypointController:
    """Steers for an aim and keeps the speed given by the distances between the waypoints.

    * The wanted speed is twice the mean distance from waypoint to waypoint, over the first `speed_pairs` pairs.
    * The aim is the first waypoint of the pair whose middle is nearest to `aim_m` metres away. The target point becomes
      the aim when it lies within `calm_within_m` and more nearly straight ahead, or when it lies less than
      `target_within_m` ahead and disagrees with the end of the waypoints. This rule helps when the network errs, and
      misleads when the GPS errs.
    * The brake is full when the wanted speed is below `brake_below_mps` (tested first, so that nothing is divided by a
      wanted speed of 0) or when the speed is more than `brake_ratio` times the wanted speed.

    Make a new controller for each episode, because it has a state.
    """

    def __init__(self, tuning: WaypointTuning) -> None:
        self.tuning = tuning
        self._turn, self._speed = WindowedPid(tuning.turn), WindowedPid(tuning.speed)

    def step(self, waypoints: Sequence[Point], speed_mps: float, target: Point) -> Control:
        """Return the control for this tick. `waypoints` are at least two; `speed_mps` and `target` are as measured."""
        tuning = self.tuning
        aim, desired = self._aim(waypoints)
        turn_to = published_turn_of if tuning.behind_is_right else turn_of
        (before_x, before_y), (last_x, last_y) = waypoints[-2], waypoints[-1]
        angle, of_target = turn_to(aim), turn_to(target)
        led_to = turn_to((last_x - before_x, last_y - before_y))
        near = scalars.hypot(target[0], target[1]) < tuning.calm_within_m
        by_target = (near and abs(of_target) < abs(angle)) or (
            abs(of_target - led_to) > tuning.target_turn and target[0] < tuning.target_within_m
        )
        steer = min(max(self._turn.step(of_target if by_target else angle), -1.0), 1.0)
        brake = desired < tuning.brake_below_mps or speed_mps / desired > tuning.brake_ratio
        missing = min(max(desired - speed_mps, 0.0), tuning.most_missing_mps)
        throttle = min(max(self._speed.step(missing), 0.0), tuning.most_throttle)
        throttle = 0.0 if brake else min(throttle, capped_throttle(tuning, speed_mps, steer))
        return Control(throttle, steer, 1.0 if brake else 0.0)

    def _aim(self, waypoints: Sequence[Point]) -> tuple[Point, float]:
        """Return (where to steer for, wanted speed in m/s)."""
        aim, best, length, pairs = waypoints[0], math.inf, 0.0, min(self.tuning.speed_pairs, len(waypoints) - 1)
        for number, (start, end) in enumerate(pairwise(waypoints)):
            if number < pairs:
                length += scalars.hypot(end[0] - start[0], end[1] - start[1])
            off = abs(0.5 * scalars.hypot(start[0] + end[0], start[1] + end[1]) - self.tuning.aim_m)
            if off < best:
                aim, best = start, off
        return aim, 2.0 * length / pairs


def capped_throttle(tuning: WaypointTuning, speed_mps: float, steer: float) -> float:
    """Return the agent's limit on the throttle at the measured speed; a speed that reads too low raises the limit."""
    if speed_mps > tuning.coast_above_mps:
        return 0.0
    free = tuning.free_turning_mps if abs(steer) > tuning.turning else tuning.free_mps
    return tuning.cruise_throttle if speed_mps > free else tuning.free_throttle


def turn_of(point: Point) -> float:
    """Return the direction of a point (forward, right) in units of 90 degrees, right positive, -2..2.

    A point nearer than half a metre has no direction worth steering for: 0.

    >>> turn_of((0.0, 3.0)), turn_of((0.1, -0.2))
    (1.0, 0.0)
    """
    x, y = point
    if x * x + y * y < 0.25:
        return 0.0
    return scalars.atan2(y, x) * (2.0 / math.pi)


def published_turn_of(point: Point) -> float:
    """Return the direction as the published agents compute it, -1..3; a point behind on the left gives 2 to 3.

    The published agents do not wrap the angle (`TCP/model.py`, `team_code/pid_controller.py`) and therefore steer right
    for every target behind the vehicle, where GPS noise can put targets. Near points have a direction, too.

    >>> published_turn_of((0.0, 3.0)), published_turn_of((0.0, -3.0)), published_turn_of((-3.0, 0.0))
    (1.0, -1.0, 2.0)
    """
    x, y = point
    return 1.0 - scalars.atan2(x, y) * (2.0 / math.pi)
