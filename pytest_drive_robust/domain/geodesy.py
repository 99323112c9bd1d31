"""Metres in the route's frame to latitude and longitude, and back.

CARLA's convention: spherical Mercator of radius 6378137 m around (0, 0); x points east, y points *south*.
"""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic import scalars

EARTH_RADIUS_M = 6378137.0


def to_geodetic(x_m: float, y_m: float) -> tuple[float, float]:
    """Return (latitude, longitude) in degrees of a point (x east, y south) in metres."""
    latitude = 2.0 * scalars.atan(scalars.exp(-y_m / EARTH_RADIUS_M)) - math.pi / 2.0
    return math.degrees(latitude), math.degrees(x_m / EARTH_RADIUS_M)


def to_metric(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return (x east, y south) in metres of a latitude and longitude in degrees; the inverse of `to_geodetic`.

    Raises `ValueError` for a latitude that is not between the poles.
    """
    if not -90.0 < latitude_deg < 90.0:
        raise ValueError(f"latitude {latitude_deg!r} degrees, expected more than -90 and less than 90")
    y = -EARTH_RADIUS_M * scalars.log(scalars.tan(math.pi / 4.0 + math.radians(latitude_deg) / 2.0))
    return EARTH_RADIUS_M * math.radians(longitude_deg), y


class GeodeticPlace:
    """Adds latitude and longitude to a class with a place in the route's frame: `x_m` metres east, `y_m` south."""

    __slots__ = ()
    x_m: float
    y_m: float

    @property
    def latitude_deg(self) -> float:
        """Latitude in degrees, by CARLA's Mercator convention."""
        return to_geodetic(self.x_m, self.y_m)[0]

    @property
    def longitude_deg(self) -> float:
        """Longitude in degrees, by CARLA's Mercator convention."""
        return to_geodetic(self.x_m, self.y_m)[1]
