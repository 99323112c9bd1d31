"""Where a pinhole camera stands and how it projects; one definition for the kernels and for tests."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.arithmetic.scalars import cos, sin, tan

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import CameraSpec

__all__ = ["CameraView", "Headlamps"]

_LOWEST_M = 0.05


class CameraView(NamedTuple):
    """A camera in the world: metres, radians (yaw clockwise from east, pitch up), focal length in pixels.

    Sines and cosines are kept beside the angles: the kernels need them for every corner.

    A point `forward`, `right`, `up` of the camera is seen at u = width / 2 + focal * right / forward and
    v = height / 2 - focal * up / forward; the centre of pixel (row, column) is (column + 0.5, row + 0.5).
    """

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float
    focal_px: float
    cos_yaw: float
    sin_yaw: float
    cos_pitch: float
    sin_pitch: float

    @classmethod
    def of(cls, camera: CameraSpec, x_m: float, y_m: float, yaw_rad: float) -> CameraView:
        """Return the view of `camera` on a vehicle whose centre is at (x, y) with this yaw; never below the ground."""
        c, s = cos(yaw_rad), sin(yaw_rad)
        yaw, pitch = yaw_rad + math.radians(camera.yaw_deg), math.radians(camera.pitch_deg)
        return cls(
            x_m + c * camera.x_m - s * camera.y_m,
            y_m + s * camera.x_m + c * camera.y_m,
            max(float(camera.z_m), _LOWEST_M),
            yaw,
            pitch,
            camera.width_px / 2.0 / tan(math.radians(camera.fov_deg) / 2.0),
            cos(yaw),
            sin(yaw),
            cos(pitch),
            sin(pitch),
        )


class Headlamps(NamedTuple):
    """The ego's headlamps: its centre in metres, yaw in radians, and strength 0..1 (0 by day)."""

    x_m: float
    y_m: float
    yaw_rad: float
    strength: float
