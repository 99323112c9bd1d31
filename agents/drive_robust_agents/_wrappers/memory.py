"""The memory of UniAD and VAD from 0.5 s ago, moved by the sensed poses, and their can bus.

The published wrappers (Bench2DriveZoo `team_code/uniad_b2d_agent.py`, `team_code/vad_b2d_agent.py`) fill an 18-number
"can bus" from GPS, compass, speedometer and IMU, and shift the bird's-eye features of the last frame by the can bus, so
that a wrong position moves the memory against the picture. Here the can bus has six numbers, and the memory is 0.5 s
old, in training and at run time (the published agents are trained at 0.5 s and driven at 0.05 s). The age of a memory
is measured by the tick of the observation, so that it stays equal for an agent that acts only every few ticks.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._wrappers.sensed_pose import SensedPose
from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["CAN_BUS", "LAG_TICKS", "Memory", "can_bus", "motion_between"]

Floats32 = NDArray[np.float32]

LAG_TICKS = 10
"""Age of the memory in ticks: 0.5 s."""

CAN_BUS = ("speed", "yaw rate", "forward acceleration", "right acceleration", "forward movement", "movement right")
"""The can bus: m/s, rad/s, m/s2, m/s2, and metres moved since the memory, in its ego frame (0 without a memory)."""


def motion_between(old: Floats, now: Floats) -> Floats32:
    """Return the present poses in the frames of the old poses: (n, 3) forward m, right m, yaw rad, from two (n, 3).

    A point (x, y) in the present frame lies at R(yaw) (x, y) + (forward, right) in the old frame.
    """
    dx, dy = (now[:, :2] - old[:, :2]).T
    c, s = arrays.cos(old[:, 2]), arrays.sin(old[:, 2])
    turned = np.remainder(now[:, 2] - old[:, 2] + math.pi, math.tau) - math.pi
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, turned]).astype(np.float32)


def can_bus(speed: Floats32, imu: Floats32, motion: Floats32) -> Floats32:
    """Return (n, 6) as `CAN_BUS` from speed (n,), IMU (n, 3: forward, right, yaw rate) and `motion_between` (n, 3)."""
    return np.column_stack([speed, imu[:, 2], imu[:, 0], imu[:, 1], motion[:, 0], motion[:, 1]]).astype(np.float32)


class Memory:
    """A ring buffer of a network's outputs in each tick, with the pose sensed in that tick.

    `shapes` gives the names and shapes of the remembered arrays, of one episode and without a batch axis.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._nothing = {name: np.zeros(shape, dtype=np.float32) for name, shape in shapes.items()}
        self._kept: deque[tuple[int, SensedPose, Mapping[str, Floats32]]] = deque()

    def recall(self, tick: int) -> tuple[SensedPose | None, Mapping[str, Floats32]]:
        """Return (pose, arrays) of the youngest memory that is at least 0.5 s old; (None, zeros) without a memory.

        When ticks were left out, a memory of up to 1 s is used.
        """
        while len(self._kept) > 1 and tick - self._kept[1][0] >= LAG_TICKS:
            self._kept.popleft()
        if self._kept and LAG_TICKS <= tick - self._kept[0][0] <= 2 * LAG_TICKS:
            _, pose, features = self._kept[0]
            return pose, features
        return None, self._nothing

    def keep(self, tick: int, pose: SensedPose, outputs: Mapping[str, Floats32]) -> None:
        """Remember this tick; a tick that is not later than the last one starts a new memory."""
        if self._kept and tick <= self._kept[-1][0]:
            self._kept.clear()
        self._kept.append((tick, pose, {name: outputs[name].copy() for name in self._nothing}))
