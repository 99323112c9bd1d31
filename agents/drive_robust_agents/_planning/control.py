"""Convert a wanted path and acceleration to pedals and steering; compute the speed profile of a path."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning.projection import project
from drive_robust_agents._vehicle import mkz
from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic.scalars import atan
from pytest_drive_robust.arithmetic.signals import moving_sum
from pytest_drive_robust.domain.truth import EgoState
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["pedals", "speed_profile", "steer_along"]

_SETTLE_M, _SETTLE_S = 2.0, 0.45


def speed_profile(route: Floats, *, lateral_mps2: float, brake_mps2: float) -> Floats:
    """Return the highest sensible speed at each row of a (n, 4) route in m/s, (n,).

    The speed is the limit of the row, lowered so that curves stay below `lateral_mps2`, and lowered before slower rows
    so that braking at `brake_mps2` is enough.
    """
    turn = np.abs(np.gradient(np.unwrap(route[:, 2]))) if len(route) > 1 else np.zeros(len(route))
    smooth = moving_sum(np.pad(turn, 3, mode="edge"), (1.0 / 7.0,) * 7)
    limits = np.minimum(route[:, 3], np.sqrt(lateral_mps2 / np.maximum(smooth, 1e-4))).tolist()
    for k in range(len(limits) - 2, -1, -1):
        limits[k] = min(limits[k], math.sqrt(limits[k + 1] * limits[k + 1] + 2.0 * brake_mps2))
    return np.array(limits)


def steer_along(ego: EgoState, line: Floats, row: int) -> float:
    """Return the steering (-1..1) that brings the ego onto a line and keeps it there.

    `line` is (n, >=3): x, y, yaw, about one row a metre; the ego is near `row`. The steering follows the curvature of
    the line, corrected by the angle and the distance to the line, so that the ego comes back without overshooting,
    within a length that grows with the speed.
    """
    at, right = project(line, row - 6, row + 14, ego.x_m, ego.y_m)
    k = int(min(max(at, 3), len(line) - 4)) if len(line) > 7 else 0
    low, high = max(k - 2, 0), min(k + 3, len(line) - 1)
    bend = math.remainder(line[high, 2] - line[low, 2], math.tau) / max(high - low, 1)
    heading = line[k, 2] + (at - k) * bend
    length = max(_SETTLE_M, _SETTLE_S * ego.speed_mps)
    slip = atan(mkz.REAR_M * bend)  # the middle moves at this angle to the heading
    lean = math.remainder(ego.yaw_rad + slip - heading, math.tau)
    return mkz.steer(bend - 2.0 * lean / length - right / (length * length))


def pedals(ego: EgoState, acceleration_mps2: float, steer: float) -> Control:
    """Return the control that brings the car to an acceleration; brakes hold a standing ego."""
    if acceleration_mps2 < -0.1 and ego.speed_mps < 0.3:
        return Control(throttle=0.0, steer=steer, brake=0.5)
    throttle, brake = mkz.pedals(ego.speed_mps, mkz.eased(ego.forward_mps2, acceleration_mps2))
    return Control(throttle=throttle, steer=steer, brake=brake)
