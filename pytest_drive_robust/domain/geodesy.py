"""Metres in the route's frame to latitude and longitude, and back.

CARLA's convention: spherical Mercator of radius 6378137 m around (0, 0); x points east, y points *south*.
"""

from __future__ import annotations

import math

__all__ = ["EARTH_RADIUS_M", "to_geodetic", "to_metric"]

EARTH_RADIUS_M = 6378137.0


def to_geodetic(x_m: float, y_m: float) -> tuple[float, float]:
    """Return (latitude, longitude) in degrees of a point (x east, y south) in metres."""
    latitude = 2.0 * math.atan(math.exp(-y_m / EARTH_RADIUS_M)) - math.pi / 2.0
    return math.degrees(latitude), math.degrees(x_m / EARTH_RADIUS_M)


def to_metric(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return (x east, y south) in metres of a latitude and longitude in degrees; the inverse of `to_geodetic`."""
    y = -EARTH_RADIUS_M * math.log(math.tan(math.pi / 4.0 + math.radians(latitude_deg) / 2.0))
    return EARTH_RADIUS_M * math.radians(longitude_deg), y
