"""The pose of the vehicle as the published wrappers take it: from GPS and compass, unfiltered."""

from __future__ import annotations

import math
from typing import NamedTuple

from pytest_drive_robust import Observation

__all__ = ["SensedPose"]


class SensedPose(NamedTuple):
    """A measured pose in the route's frame: metres, radians clockwise from east."""

    x_m: float
    y_m: float
    yaw_rad: float

    @staticmethod
    def of(observation: Observation) -> SensedPose:
        """Return the pose of one tick; a compass value of NaN becomes 0, as in the published wrappers."""
        yaw = observation.compass.yaw_rad
        return SensedPose(observation.gps.x_m, observation.gps.y_m, 0.0 if math.isnan(yaw) else yaw)
