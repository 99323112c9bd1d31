"""The ego in highway-env: its vehicle, and what throttle, brake and steer do to it."""

from __future__ import annotations

import copy
import math

import numpy as np
from highway_env.envs.common.action import ContinuousAction
from highway_env.vehicle.kinematics import Vehicle

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.jit.arrays import Floats

_BRAKE_MPS2, _ENGINE_MPS2 = 8.0, 5.0
"""Accelerations of full brake and full throttle, because highway-env has no pedals."""
_POWER_WPKG = 55.0
"""Power per mass, which limits the acceleration at speed."""
_STEER_RAD, _WHEELBASE_M = 0.61, 2.85
"""Wheel angle of a full `steer` and wheelbase, which give the curvature of the path for a car of any length."""
ACCELERATION_RANGE_MPS2 = (-_BRAKE_MPS2, _ENGINE_MPS2)
STEERING_RANGE_RAD = (-0.9, 0.9)
"""Range of steering angles; a full `steer` needs 0.887 rad on highway-env's car, with its wheelbase of 5 m."""


class EgoVehicle(Vehicle):  # type: ignore[misc]
    """The ego as environments make it, with a memory for its destination and without copies of the world.

    Environments call `plan_route_to` on every ego and ignore that a plain `Vehicle` has no such method. The destination
    in this call is the end of the route.

    highway-env's `predict_trajectory_constant_speed` deep-copies the vehicle and with it the road and all cars, twice
    a second for every pair: a fifth of the time of an intersection. Ours gives the same numbers.
    """

    destination_node: str | None = None

    def plan_route_to(self, destination: str) -> EgoVehicle:
        """Remember the node of the road network that the ego is to reach."""
        self.destination_node = str(destination)
        return self

    def predict_trajectory_constant_speed(self, times: Floats) -> tuple[list[Floats], list[float]]:
        """Return (positions, headings) at `times` in seconds from now, with the steering of now and no acceleration."""
        twin = copy.copy(self)
        twin.road = None  # its lane is never looked up
        twin.position = self.position.copy()
        steering = self.action["steering"] if self.prediction_type == "constant_steering" else 0.0
        twin.action = {"acceleration": 0.0, "steering": steering}
        positions, headings = [], []
        for dt_s in np.diff(np.concatenate(([0.0], times))):
            twin.step(dt_s)
            positions.append(twin.position.copy())
            headings.append(twin.heading)
        return positions, headings


class EgoAction(ContinuousAction):  # type: ignore[misc]
    """highway-env's continuous action for an ego of our class."""

    @property
    def vehicle_class(self) -> type[EgoVehicle]:
        """The class of the vehicle that environments put on the road as the ego."""
        return EgoVehicle


def acceleration_and_steering(
    control: Control, *, speed_mps: float, length_m: float, dt_s: float
) -> tuple[float, float]:
    """Return (m/s2, rad) for highway-env's bicycle model of a car of `length_m`.

    Pedals act in proportion and at once, unlike those of the embedded world's car: throttle up to 5 m/s2, less at
    speed; brakes up to 8 m/s2. The steering sets the curvature of the path. A brake never becomes a reverse gear: the
    acceleration is limited to what brings the car to rest within `dt_s`.
    """
    engine_mps2 = min(_ENGINE_MPS2, _POWER_WPKG / max(speed_mps, 1.0))
    push_mps2 = control.throttle * engine_mps2 if control.brake <= 0.0 else -control.brake * _BRAKE_MPS2
    curvature = math.tan(control.steer * _STEER_RAD) / _WHEELBASE_M
    return max(push_mps2, -max(speed_mps, 0.0) / dt_s), math.atan(length_m * curvature)


def action_of(acceleration_mps2: float, steering_rad: float, action_type: ContinuousAction) -> Floats:
    """Return the two numbers in -1..1 that `action_type` maps to this acceleration and steering angle."""
    wanted = ((acceleration_mps2, action_type.acceleration_range), (steering_rad, action_type.steering_range))
    shares = [2.0 * (value - float(low)) / (float(high) - float(low)) - 1.0 for value, (low, high) in wanted]
    return np.array([min(max(share, -1.0), 1.0) for share in shares])
