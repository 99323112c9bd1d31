"""The ego of a highway-env world, and how a control becomes its action."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
from highway_env.envs.common.action import ContinuousAction
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.simulators.embedded.kernels.ego import (
    ACCEL_MAX_MPS2,
    BRAKE_MAX_MPS2,
    POWER_WPKG,
    STEER_MAX_RAD,
    WHEELBASE_M,
)

__all__ = [
    "ACCELERATION_RANGE_MPS2",
    "STEERING_RANGE_RAD",
    "EgoAction",
    "EgoVehicle",
    "acceleration_and_steering",
    "action_of",
]

ACCELERATION_RANGE_MPS2 = (-BRAKE_MAX_MPS2, ACCEL_MAX_MPS2)
STEERING_RANGE_RAD = (-0.9, 0.9)
"""A full turn of the wheel needs 0.887 rad of highway-env's car, whose wheelbase is its length of 5 m."""


class EgoVehicle(Vehicle):  # type: ignore[misc]
    """The ego as environments make it, with a memory for its destination and without copies of the world.

    Environments call `plan_route_to` on every ego and ignore that a plain `Vehicle` has no such method; their answer
    to "where shall the ego go?" is what a route needs.

    highway-env's `predict_trajectory_constant_speed` deep-copies the vehicle and with it the road and all cars, twice
    a second for every pair: a fifth of the time of an intersection. Ours gives the same numbers.
    """

    destination_node: str | None = None

    def plan_route_to(self, destination: str) -> EgoVehicle:
        """Remember the node of the road network that the ego is to reach."""
        self.destination_node = str(destination)
        return self

    def predict_trajectory_constant_speed(
        self, times: NDArray[np.float64]
    ) -> tuple[list[NDArray[np.float64]], list[float]]:
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
        """Whom environments put on the road as the ego."""
        return EgoVehicle


def acceleration_and_steering(
    control: Control, *, speed_mps: float, length_m: float, dt_s: float
) -> tuple[float, float]:
    """Return (m/s2, rad) for highway-env's bicycle model of a car of `length_m`.

    A control means what it means in the embedded world: the same curvature of the path and the same push, without the
    lags, which highway-env does not have. A brake never becomes a reverse gear: the acceleration is limited to what
    brings the car to rest within `dt_s`.
    """
    engine_mps2 = min(ACCEL_MAX_MPS2, POWER_WPKG / max(speed_mps, 1.0))
    push_mps2 = control.throttle * engine_mps2 if control.brake <= 0.0 else -control.brake * BRAKE_MAX_MPS2
    curvature = math.tan(control.steer * STEER_MAX_RAD) / WHEELBASE_M
    return max(push_mps2, -max(speed_mps, 0.0) / dt_s), math.atan(length_m * curvature)


def action_of(acceleration_mps2: float, steering_rad: float, action_type: ContinuousAction) -> NDArray[np.float64]:
    """Return the two numbers in -1..1 that `action_type` maps to this acceleration and steering angle."""
    return np.array(
        [
            _share(acceleration_mps2, action_type.acceleration_range),
            _share(steering_rad, action_type.steering_range),
        ]
    )


def _share(value: float, limits: Any) -> float:
    low, high = float(limits[0]), float(limits[1])
    return min(max(2.0 * (value - low) / (high - low) - 1.0, -1.0), 1.0)
