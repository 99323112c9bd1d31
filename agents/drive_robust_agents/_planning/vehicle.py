"""The vehicles that the agents here are made for: those of the embedded world.

Whoever makes an agent knows what a control does to the vehicle; no agent asks the simulator.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

from drive_robust_agents._planning import mkz
from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic.scalars import atan, cos, sin, tan
from pytest_drive_robust.errors import UnknownNameError

__all__ = [
    "ACCEL_MAX_MPS2",
    "BRAKE_MAX_MPS2",
    "POWER_WPKG",
    "STEER_MAX_RAD",
    "WHEELBASE_M",
    "Bicycle",
    "Mkz",
    "Moved",
    "Pedals",
    "Vehicle",
    "vehicle_called",
]

_DT_S = 0.05
_EASE = 0.22
"""The share of a tick on the way to a higher acceleration: that of an engine with a lag of 0.2 s (`forecast`)."""
WHEELBASE_M = 2.85
STEER_MAX_RAD = 0.61
"""What a full `steer` turns the wheels by."""
ACCEL_MAX_MPS2 = 5.0
BRAKE_MAX_MPS2 = 8.0
POWER_WPKG = 55.0
"""Caps the acceleration at speed, W per kg."""


class Pedals(NamedTuple):
    """Throttle and brake, 0 to 1."""

    throttle: float
    brake: float


class Moved(NamedTuple):
    """What a tick does: where the middle moves beside the heading, the turn for each m/s, the speed afterwards."""

    slip_rad: float
    turn_rad: float
    speed_mps: float


class Vehicle(Protocol):
    """What a control does to a vehicle, and backwards. Its middle is `rear_m` before the rear axle."""

    rear_m: float
    wheelbase_m: float
    """Wheels that are turned by a small angle make its middle follow a curvature of the angle over this."""
    steer_max_rad: float
    """What a full `steer` turns the wheels by."""
    steer_delay_s: float
    """The wheels follow the steering late by about this much."""

    def steer(self, curvature_per_m: float) -> float:
        """Return the steering (-1..1) that makes the middle follow a curvature, or the nearest that there is."""

    def pedals(self, speed_mps: float, acceleration_mps2: float) -> Pedals:
        """Return the pedals that give an acceleration, or the nearest that there is."""

    def eased(self, acceleration_mps2: float, wanted_mps2: float) -> float:
        """Return the acceleration to ask for in this tick, of that of now and of the wanted one."""

    def as_bicycle(self, speed_mps: float, pedals: Pedals) -> Pedals:
        """Return the pedals that accelerate this vehicle as much as `pedals` accelerate the bicycle."""

    def steer_as_bicycle(self, steer: float) -> float:
        """Return the steering with which this vehicle follows the curvature that the bicycle follows with `steer`."""

    def moved(self, speed_mps: float, control: Control) -> Moved:
        """Return what a control does in a tick, but for lags, drag and the limits of grip."""


class Bicycle:
    """The world's own: a kinematic bicycle with drag, a power limit, lags and a steering rate."""

    rear_m = 0.5 * WHEELBASE_M
    wheelbase_m, steer_max_rad = WHEELBASE_M, STEER_MAX_RAD
    steer_delay_s = 0.15

    def steer(self, curvature_per_m: float) -> float:
        """Return the steering: the slip of the middle is left out."""
        return min(max(atan(WHEELBASE_M * curvature_per_m) / STEER_MAX_RAD, -1.0), 1.0)

    def pedals(self, speed_mps: float, acceleration_mps2: float) -> Pedals:
        """Return the pedals, once the lags are over."""
        push = acceleration_mps2 + 0.12 + 0.018 * speed_mps + 0.0006 * speed_mps * speed_mps
        engine = min(ACCEL_MAX_MPS2, POWER_WPKG / max(speed_mps, 1.0))
        return Pedals(min(max(push / engine, 0.0), 1.0), min(max(-push / BRAKE_MAX_MPS2, 0.0), 1.0))

    def eased(self, acceleration_mps2: float, wanted_mps2: float) -> float:
        """Return the wanted one: the vehicle has lags of its own."""
        return wanted_mps2

    def as_bicycle(self, speed_mps: float, pedals: Pedals) -> Pedals:
        """Return the pedals as they are."""
        return pedals

    def steer_as_bicycle(self, steer: float) -> float:
        """Return the steering as it is."""
        return steer

    def moved(self, speed_mps: float, control: Control) -> Moved:
        """Return the tick of a kinematic bicycle about its middle."""
        tangent = tan(control.steer * STEER_MAX_RAD)
        slip = atan(0.5 * tangent)
        push = control.throttle * min(ACCEL_MAX_MPS2, POWER_WPKG / max(speed_mps, 1.0)) if control.brake <= 0.0 else 0.0
        after = max(speed_mps + _DT_S * (push - control.brake * BRAKE_MAX_MPS2), 0.0)
        return Moved(slip, _DT_S * cos(slip) * tangent / WHEELBASE_M, after)


class Mkz:
    """CARLA's Lincoln MKZ as it was fitted: see `mkz`."""

    rear_m = mkz.REAR_M
    wheelbase_m, steer_max_rad = mkz.FRONT_M + mkz.REAR_M, mkz.STEER_MAX_RAD
    steer_delay_s = 0.0

    def steer(self, curvature_per_m: float) -> float:
        """Return the steering, as long as the tyres hold."""
        sine = min(max(mkz.REAR_M * curvature_per_m, -0.9), 0.9)  # more than the wheels can
        tangent = sine / math.sqrt(1.0 - sine * sine)
        wheel = atan(tangent * (mkz.FRONT_M + mkz.REAR_M) / mkz.REAR_M)
        return min(max(wheel / mkz.STEER_MAX_RAD, -1.0), 1.0)

    def pedals(self, speed_mps: float, acceleration_mps2: float) -> Pedals:
        """Return the pedals for the next tick."""
        return Pedals(*mkz.pedals(speed_mps, acceleration_mps2))

    def eased(self, acceleration_mps2: float, wanted_mps2: float) -> float:
        """Return the wanted one when it is less, else something on the way to it, as plans expect of an engine.

        Without that a plan of one tick would be driven before the next one is made, back and forth.
        """
        return min(wanted_mps2, acceleration_mps2 + _EASE * (wanted_mps2 - acceleration_mps2))

    def as_bicycle(self, speed_mps: float, pedals: Pedals) -> Pedals:
        """Return what gives the bicycle's acceleration, once its lags are over."""
        engine = min(ACCEL_MAX_MPS2, POWER_WPKG / max(speed_mps, 1.0))
        push = -BRAKE_MAX_MPS2 * pedals.brake if pedals.brake > 0.0 else engine * pedals.throttle
        return self.pedals(speed_mps, push - 0.12 - 0.018 * speed_mps - 0.0006 * speed_mps * speed_mps)

    def steer_as_bicycle(self, steer: float) -> float:
        """Return the steering by the curvature of the bicycle's middle, its slip included."""
        tangent = tan(steer * STEER_MAX_RAD)
        return self.steer(cos(atan(0.5 * tangent)) * tangent / WHEELBASE_M)

    def moved(self, speed_mps: float, control: Control) -> Moved:
        """Return the tick by the fits."""
        slip = atan(mkz.REAR_M / (mkz.FRONT_M + mkz.REAR_M) * tan(control.steer * mkz.STEER_MAX_RAD))
        after = mkz.speed_after(speed_mps, control.throttle, control.brake)
        return Moved(slip, _DT_S * sin(slip) / mkz.REAR_M, after)


_VEHICLES: dict[str, type[Bicycle] | type[Mkz]] = {"bicycle": Bicycle, "mkz": Mkz}


def vehicle_called(name: str, *, agent: str) -> Vehicle:
    """Return the vehicle of that name. Raises `UnknownNameError` with a hint for `agent`."""
    if name not in _VEHICLES:
        raise UnknownNameError.of("vehicle", name, _VEHICLES, hint=f"As in '{agent}:vehicle=mkz'.")
    return _VEHICLES[name]()
