"""From a wanted path and a wanted acceleration to pedals and steering; how fast a path can be driven."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.projection import project
from drive_robust_agents._planning.vehicle import Mkz, Vehicle
from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic.scalars import atan, cos, sin
from pytest_drive_robust.arithmetic.signals import moving_sum
from pytest_drive_robust.domain.truth import EgoState

__all__ = ["Floats", "pedals", "speed_profile", "steer_along"]

Floats = NDArray[np.float64]

_MKZ = Mkz()
_SETTLE_M, _SETTLE_S = 2.0, 0.45


def speed_profile(route: Floats, *, lateral_mps2: float, brake_mps2: float) -> Floats:
    """Return the highest sensible speed at each row of a (n, 4) route in m/s, (n,).

    The limit of the row, lowered so that curves stay below `lateral_mps2`, and lowered before slower rows so that
    braking at `brake_mps2` reaches them in time.
    """
    turn = np.abs(np.gradient(np.unwrap(route[:, 2]))) if len(route) > 1 else np.zeros(len(route))
    smooth = moving_sum(np.pad(turn, 3, mode="edge"), (1.0 / 7.0,) * 7)
    limits = np.minimum(route[:, 3], np.sqrt(lateral_mps2 / np.maximum(smooth, 1e-4))).tolist()
    for k in range(len(limits) - 2, -1, -1):
        limits[k] = min(limits[k], math.sqrt(limits[k + 1] * limits[k + 1] + 2.0 * brake_mps2))
    return np.array(limits)


def steer_along(ego: EgoState, line: Floats, row: int, *, vehicle: Vehicle = _MKZ) -> float:
    """Return the steering (-1..1) that brings the ego onto a line and keeps it there.

    `line` is (n, >=3): x, y, yaw, about one row a metre; the ego is near `row`. The curvature of the line, corrected by
    the angle and the distance to it so that the ego comes back without overshooting, within a length that grows with
    the speed; all at the place where the ego will be once the wheels have turned.
    """
    v, reach = ego.speed_mps, ego.speed_mps * vehicle.steer_delay_s
    yaw = ego.yaw_rad + ego.yaw_rate_radps * vehicle.steer_delay_s
    slip = atan(vehicle.rear_m * ego.yaw_rate_radps / max(v, 1.0))  # the middle moves aside of the nose
    moves = 0.5 * (ego.yaw_rad + yaw) + slip
    x, y = ego.x_m + reach * cos(moves), ego.y_m + reach * sin(moves)
    at, right = project(line, row - 6, row + 14, x, y)
    k = int(min(max(at, 3), len(line) - 4)) if len(line) > 7 else 0
    low, high = max(k - 2, 0), min(k + 3, len(line) - 1)
    bend = math.remainder(line[high, 2] - line[low, 2], math.tau) / max(high - low, 1)
    heading = line[k, 2] + (at - k) * bend
    length = max(_SETTLE_M, _SETTLE_S * v)
    lean = math.remainder(yaw + atan(vehicle.rear_m * bend) - heading, math.tau)
    return vehicle.steer(bend - 2.0 * lean / length - right / (length * length))


def pedals(ego: EgoState, acceleration_mps2: float, steer: float, *, vehicle: Vehicle = _MKZ) -> Control:
    """Return the control that brings a vehicle to an acceleration; brakes hold a standing ego."""
    if acceleration_mps2 < -0.1 and ego.speed_mps < 0.3:
        return Control(throttle=0.0, steer=steer, brake=0.5)
    throttle, brake = vehicle.pedals(ego.speed_mps, vehicle.eased(ego.forward_mps2, acceleration_mps2))
    return Control(throttle=throttle, steer=steer, brake=brake)
