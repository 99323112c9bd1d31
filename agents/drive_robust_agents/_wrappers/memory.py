"""What UniAD and VAD know of half a second ago: the can bus, and a memory that is moved by where they think they are.

The published wrappers (Bench2DriveZoo `team_code/uniad_b2d_agent.py`, `team_code/vad_b2d_agent.py`) fill an 18-number
"can bus" from GPS, compass, speedometer and IMU, and the bird's-eye features of the last frame are shifted by it, so
that a wrong position moves the memory against the picture. Here the can bus has six numbers, and the memory is the one
of 0.5 s ago, in training as at run time (the published ones are trained at 0.5 s and driven at 0.05 s). Its age is
told by the tick of the observation, so that it is the same where the agent is asked only every few ticks.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust import Observation
from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["CAN_BUS", "LAG_TICKS", "Memory", "Sensed", "can_bus", "motion_between"]

Floats32 = NDArray[np.float32]

LAG_TICKS = 10
"""How old the memory is: 0.5 s."""

CAN_BUS = ("speed", "yaw rate", "forward acceleration", "right acceleration", "forward movement", "movement right")
"""m/s, rad/s, m/s2, m/s2, and the metres moved since the memory, in the ego frame of then (0 without a memory)."""


def motion_between(old: Floats, now: Floats) -> Floats32:
    """Return the pose of now seen from that of before.

    Gives (n, 3) forward m, right m, yaw rad from two (n, 3) arrays of poses.

    A point (x, y) in the frame of now lies at R(yaw) (x, y) + (forward, right) in the frame of then.
    """
    dx, dy = (now[:, :2] - old[:, :2]).T
    c, s = arrays.cos(old[:, 2]), arrays.sin(old[:, 2])
    turned = np.remainder(now[:, 2] - old[:, 2] + math.pi, math.tau) - math.pi
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, turned]).astype(np.float32)


def can_bus(speed: Floats32, imu: Floats32, motion: Floats32) -> Floats32:
    """Return (n, 6) as `CAN_BUS` from speed (n,), IMU (n, 3: forward, right, yaw rate) and `motion_between` (n, 3)."""
    return np.column_stack([speed, imu[:, 2], imu[:, 0], imu[:, 1], motion[:, 0], motion[:, 1]]).astype(np.float32)


class Sensed(NamedTuple):
    """The pose that GPS and compass measured: metres and rad in the route's frame; a compass that says NaN is 0."""

    x_m: float
    y_m: float
    yaw_rad: float

    @staticmethod
    def of(observation: Observation) -> Sensed:
        """Return the pose of one tick, unfiltered, as the published wrappers take it."""
        yaw = observation.compass.yaw_rad
        return Sensed(observation.gps.x_m, observation.gps.y_m, 0.0 if math.isnan(yaw) else yaw)


class Memory:
    """A ring buffer of what a network gave in each tick, with the pose that was sensed then.

    `shapes` names what is remembered: arrays of one episode, without a batch axis.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._nothing = {name: np.zeros(shape, dtype=np.float32) for name, shape in shapes.items()}
        self._kept: deque[tuple[int, Sensed, Mapping[str, Floats32]]] = deque()

    def recall(self, tick: int) -> tuple[Sensed | None, Mapping[str, Floats32]]:
        """Return the youngest memory that is 0.5 s old, with its pose; None and zeros without one.

        Where ticks are left out, one of up to 1 s is taken.
        """
        while len(self._kept) > 1 and tick - self._kept[1][0] >= LAG_TICKS:
            self._kept.popleft()
        if self._kept and LAG_TICKS <= tick - self._kept[0][0] <= 2 * LAG_TICKS:
            _, pose, features = self._kept[0]
            return pose, features
        return None, self._nothing

    def keep(self, tick: int, pose: Sensed, outputs: Mapping[str, Floats32]) -> None:
        """Remember this tick; a tick that is not later than the last one starts a new memory."""
        if self._kept and tick <= self._kept[-1][0]:
            self._kept.clear()
        self._kept.append((tick, pose, {name: outputs[name].copy() for name in self._nothing}))
