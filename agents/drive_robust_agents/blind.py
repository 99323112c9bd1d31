"""`blind`: follows the plan by raw GPS at one speed and looks at nothing. A route that it passes needs no camera.

A driving score below or near that of `blind` says nothing about an agent's perception.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drive_robust_agents._planning.control import pedals, speed_profile, steer_along
from drive_robust_agents._planning.projection import project
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.arithmetic.arrays import atan2, hypot
from pytest_drive_robust.arithmetic.signals import interpolate
from pytest_drive_robust.domain.truth import EgoState
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Blind"]

_LATERAL_MPS2, _BRAKE_MPS2 = 2.8, 2.0
_GAIN_PER_S, _ACCEL_MPS2, _HARDEST_MPS2 = 1.5, 2.5, 4.0
_BACK_ROWS, _AHEAD_ROWS = 5, 15
_BEYOND_M = 30.0
"""Metres by which the line continues beyond the plan's end."""


class Blind:
    """Keeps `speed` metres per second along the plan, less in bends; knows of no limit, light, sign or body.

    Raises `UsageError` for a speed that is not finite and above 0.
    """

    portable_bits = True
    consumes = frozenset({"gps", "compass", "imu", "speed"})

    def __init__(self, speed: float = 8.0) -> None:
        self.check(speed)
        self.speed_mps = speed
        self._line: Floats = np.zeros((0, 4))
        self._row = 0.0

    @classmethod
    def check(cls, speed: float = 8.0) -> None:
        """Raise `UsageError` for a speed that is not finite and above 0."""
        if not (math.isfinite(speed) and speed > 0.0):
            raise UsageError(f"blind has the speed {speed!r}, expected m/s above 0, as in 'blind:speed=8'.")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Lay a line through the plan; forget the last episode."""
        line = _line_through(route)
        limits = np.column_stack([line, np.full(len(line), self.speed_mps)])
        self._line = np.column_stack([line, speed_profile(limits, lateral_mps2=_LATERAL_MPS2, brake_mps2=_BRAKE_MPS2)])
        self._row = 0.0

    def act(self, observation: Observation) -> Control:
        """Follow the line. Raises `ValueError` before the first `reset`."""
        if not len(self._line):
            raise ValueError("blind has no plan to follow: was reset called?")
        ego = _state(observation)
        row = int(self._row)
        self._row, _ = project(self._line, row - _BACK_ROWS, row + _AHEAD_ROWS, ego.x_m, ego.y_m)
        self._row = min(max(self._row, 0.0), len(self._line) - 1.0)
        row = int(self._row)
        wanted = float(self._line[min(row + int(0.3 * ego.speed_mps) + 1, len(self._line) - 1), 3])
        push = min(max(_GAIN_PER_S * (wanted - ego.speed_mps), -_HARDEST_MPS2), _ACCEL_MPS2)
        return pedals(ego, push, steer_along(ego, self._line, row))


def _line_through(plan: GlobalPlan) -> Floats:
    """Return (n, 3) x, y, yaw, one row a metre, through the dense plan, or through the sparse plan without it.

    Raises `ValueError` for a plan without points.
    """
    points = np.array([(point.x_m, point.y_m) for point in plan.dense or plan.points], dtype=np.float64)
    if not len(points):
        raise ValueError("the plan has no points, expected at least one")
    steps = np.diff(points, axis=0)
    lengths = hypot(steps[:, 0], steps[:, 1])
    kept = np.concatenate([[True], lengths > 1e-6])
    points, lengths = points[kept], lengths[kept[1:]]
    last = points[-1] - points[-2] if len(points) > 1 else np.array([1.0, 0.0])
    beyond = points[-1] + last * (_BEYOND_M / float(hypot(*last)))
    points = np.concatenate([points, beyond[None]])
    along = np.concatenate([[0.0], np.cumsum([*lengths.tolist(), _BEYOND_M])])
    placed = interpolate(np.arange(0.0, float(along[-1]), 1.0), along, points)
    ahead = np.diff(placed, axis=0)
    yaw = atan2(ahead[:, 1], ahead[:, 0])
    return np.column_stack([placed, np.concatenate([yaw, yaw[-1:]])])


def _state(observation: Observation) -> EgoState:
    """Return the ego's state as measured by its sensors; the size is not used."""
    imu = observation.imu
    return EgoState(
        x_m=observation.gps.x_m,
        y_m=observation.gps.y_m,
        yaw_rad=observation.compass.yaw_rad,
        speed_mps=observation.speed.mps,
        forward_mps2=imu.forward_mps2,
        right_mps2=imu.right_mps2,
        yaw_rate_radps=imu.yaw_rate_radps,
        length_m=0.0,
        width_m=0.0,
    )
