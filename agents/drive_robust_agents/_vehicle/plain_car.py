"""Convert controls for a plain car to controls with which the driven car (`mkz`) moves alike.

Our controller numbers (`tuning="ours"`, `classical`) were tuned for a plain car: a kinematic car whose throttle and
brakes act in proportion, with drag and with limited engine power.
"""

from __future__ import annotations

from drive_robust_agents._vehicle import mkz
from drive_robust_agents._vehicle.mkz import Pedals
from pytest_drive_robust.arithmetic.scalars import atan, cos, tan

__all__ = ["WHEELBASE_M", "pedals_from_plain", "steer_from_plain"]

WHEELBASE_M = 2.85
_STEER_MAX_RAD = 0.61
_ACCEL_MAX_MPS2, _BRAKE_MAX_MPS2 = 5.0, 8.0
"""Wheel angle, acceleration and deceleration of full controls."""
_POWER_WPKG = 55.0
"""Power per mass of the plain car, which limits its acceleration at speed."""
_ROLLING_MPS2, _DRAG_PER_S, _DRAG_PER_M = 0.12, 0.018, 0.0006
"""Its deceleration without pedals: at any speed, per m/s, and per (m/s)2."""


def pedals_from_plain(speed_mps: float, plain: Pedals) -> Pedals:
    """Return the pedals with which the car accelerates as a plain car does with the pedals `plain`."""
    engine = min(_ACCEL_MAX_MPS2, _POWER_WPKG / max(speed_mps, 1.0))
    push = -_BRAKE_MAX_MPS2 * plain.brake if plain.brake > 0.0 else engine * plain.throttle
    rolling = push - _ROLLING_MPS2 - _DRAG_PER_S * speed_mps - _DRAG_PER_M * speed_mps * speed_mps
    return mkz.pedals(speed_mps, rolling)


def steer_from_plain(plain: float) -> float:
    """Return the steering (-1..1) with which the car follows the curvature of a plain car steered by `plain`."""
    tangent = tan(plain * _STEER_MAX_RAD)
    return mkz.steer(cos(atan(0.5 * tangent)) * tangent / WHEELBASE_M)
