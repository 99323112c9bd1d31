"""From a wanted path and a wanted acceleration to pedals and steering; how fast a path can be driven."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust import Control
from pytest_drive_robust.domain.truth import EgoState

__all__ = ["Floats", "look_ahead_m", "pedals", "speed_profile", "steer_to"]

Floats = NDArray[np.float64]

_WHEELBASE_M, _STEER_MAX_RAD = 2.85, 0.61
_ACCEL_MAX_MPS2, _BRAKE_MAX_MPS2, _POWER_WPKG = 5.0, 8.0, 55.0
_STEER_DELAY_S = 0.12
"""The steering wheel follows late by about this much; pursuit starts from where the ego will be then."""


def speed_profile(route: Floats, *, lateral_mps2: float, brake_mps2: float) -> Floats:
    """The highest sensible speed at each row of a (n, 4) route in m/s, (n,).

    The limit of the row, lowered so that curves stay below `lateral_mps2`, and lowered before slower rows so that
    braking at `brake_mps2` reaches them in time.
    """
    heading = np.unwrap(route[:, 2])
    turn = np.abs(np.gradient(heading)) if len(route) > 1 else np.zeros(len(route))
    smooth = np.convolve(np.pad(turn, 3, mode="edge"), np.ones(7) / 7.0, mode="valid")
    limits: Floats = np.minimum(route[:, 3], np.sqrt(lateral_mps2 / np.maximum(smooth, 1e-4)))
    for k in range(len(limits) - 2, -1, -1):
        limits[k] = min(limits[k], math.sqrt(limits[k + 1] ** 2 + 2.0 * brake_mps2))
    return limits


def look_ahead_m(speed_mps: float) -> float:
    """How far ahead the point lies that the ego steers at."""
    return float(np.clip(0.55 * speed_mps + 2.5, 3.5, 14.0))


def steer_to(ego: EgoState, x_m: float, y_m: float) -> float:
    """Pure pursuit: the steering (-1..1) whose arc leads from the ego to a point of the world."""
    reach = ego.speed_mps * _STEER_DELAY_S
    yaw = ego.yaw_rad + ego.yaw_rate_radps * _STEER_DELAY_S
    dx, dy = x_m - ego.x_m - reach * math.cos(yaw), y_m - ego.y_m - reach * math.sin(yaw)
    forward = dx * math.cos(yaw) + dy * math.sin(yaw)
    right = -dx * math.sin(yaw) + dy * math.cos(yaw)
    curvature = 2.0 * right / max(forward * forward + right * right, 1.0)
    return float(np.clip(math.atan(_WHEELBASE_M * curvature) / _STEER_MAX_RAD, -1.0, 1.0))


def pedals(ego: EgoState, acceleration_mps2: float, steer: float) -> Control:
    """The control that gives an acceleration against drag and engine power; firm brakes hold a standing ego."""
    v = ego.speed_mps
    if acceleration_mps2 < -0.1 and v < 0.3:
        return Control(throttle=0.0, steer=steer, brake=0.5)
    push = acceleration_mps2 + 0.12 + 0.018 * v + 0.0006 * v * v
    engine = min(_ACCEL_MAX_MPS2, _POWER_WPKG / max(v, 1.0))
    return Control(
        throttle=float(np.clip(push / engine, 0.0, 1.0)),
        steer=steer,
        brake=float(np.clip(-push / _BRAKE_MAX_MPS2, 0.0, 1.0)),
    )
