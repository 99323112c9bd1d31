"""What the agent sees in one tick: cameras, GPS, compass, IMU, speed, each with the tick of its capture.

Frames of reference are CARLA's and highway-env's: x forward (world: east), y to the right (world: south), z up;
yaw grows clockwise seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.geodesy import GeodeticPlace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.truth import GroundTruth

    Pixels = NDArray[np.uint8]

_LARGEST_SIDE_PX = 4096


@dataclass(frozen=True, slots=True)
class CameraSpec:
    """One camera of an agent's rig: pinhole, no distortion, mounted on the vehicle.

    `x_m`, `y_m`, `z_m` are metres forward, right and up of the centre of the vehicle on the ground; `yaw_deg` turns
    right, `pitch_deg` up; `fov_deg` is the horizontal field of view; `rate_hz` is how often a new image is captured
    (in between, the last one is delivered again with the tick of its capture).
    """

    name: str
    x_m: float = 0.8
    y_m: float = 0.0
    z_m: float = 1.6
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    fov_deg: float = 70.0
    width_px: int = 256
    height_px: int = 144
    rate_hz: float = 20.0

    def problem(self, dt_s: float) -> str | None:
        """Return what is wrong with this camera where a tick lasts `dt_s` (`"fov_deg is 0, ..."`), or None."""
        if not isinstance(self.name, str) or not self.name:
            return f"its name is {self.name!r}, expected text"
        for field_name in ("width_px", "height_px"):
            side = getattr(self, field_name)
            if not isinstance(side, int) or not 1 <= side <= _LARGEST_SIDE_PX:
                return f"{field_name} is {side!r}, expected a whole number in 1..{_LARGEST_SIDE_PX}"
        for field_name in ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "fov_deg", "rate_hz"):
            number = getattr(self, field_name)
            if not isinstance(number, (int, float)) or not math.isfinite(number):
                return f"{field_name} is {number!r}, expected a finite number"
        if not 1.0 <= self.fov_deg <= 179.0:
            return f"fov_deg is {self.fov_deg:g}, expected 1..179"
        period = 1.0 / (dt_s * self.rate_hz) if self.rate_hz > 0.0 else 0.0  # in ticks
        if period <= 0.5 or abs(period - round(period)) >= 1e-6:
            tick_rate_hz = round(1.0 / dt_s)
            rates = ", ".join(f"{tick_rate_hz / n:g}" for n in range(1, tick_rate_hz + 1) if tick_rate_hz % n == 0)
            return f"rate_hz is {self.rate_hz:g}, expected a rate that divides {tick_rate_hz} Hz, such as {rates}"
        return None

    def image_problem(self, image: object) -> str | None:
        """Return why `image` cannot be of this camera (`"front is (4, 16, 3) uint8, expected ..."`), or None."""
        if not isinstance(image, Image):
            return f"{self.name} is a {type(image).__name__}, expected an Image"
        shape, kind = getattr(image.pixels, "shape", None), getattr(image.pixels, "dtype", None)
        if shape is None or kind is None:
            return f"the pixels of {self.name} are a {type(image.pixels).__name__}, expected an array"
        expected = (self.height_px, self.width_px, 3)
        if shape != expected or kind != "uint8":
            return f"{self.name} is {shape} {kind}, expected {expected} uint8"
        return None


@dataclass(frozen=True, slots=True)
class Image:
    """`pixels` is (height, width, 3) uint8 RGB; `tick` is the tick of capture."""

    pixels: Pixels
    tick: int

    def read_only(self) -> Image:
        """Return this image with read-only pixels, a view of the same memory."""
        pixels = self.pixels.view()
        pixels.flags.writeable = False
        return Image(pixels, self.tick)


@dataclass(frozen=True, slots=True)
class Gps(GeodeticPlace):
    """Position of the centre of the vehicle, metres in the route's frame (x east, y south)."""

    x_m: float
    y_m: float
    tick: int


@dataclass(frozen=True, slots=True)
class Compass:
    """`heading_rad` is clockwise from north, as CARLA's IMU gives it; `yaw_rad` is clockwise from east (x)."""

    heading_rad: float
    tick: int

    @property
    def yaw_rad(self) -> float:
        """Yaw in the route's frame: heading minus a quarter turn."""
        return self.heading_rad - math.pi / 2.0


@dataclass(frozen=True, slots=True)
class Imu:
    """Acceleration in the vehicle's frame (forward, right) in m/s2 and yaw rate (clockwise) in rad/s."""

    forward_mps2: float
    right_mps2: float
    yaw_rate_radps: float
    tick: int


@dataclass(frozen=True, slots=True)
class Speed:
    """Forward speed in m/s."""

    mps: float
    tick: int


@dataclass(frozen=True, slots=True)
class Observation:
    """Everything that the agent is given in `tick`.

    `tick` counts the ticks of the simulator from 0, also when signals are late or frozen. The difference between the
    ticks of two observations is the time between them, also where the agent does not run in every tick (latency in the
    mode `hold`). A wrapper that counts each call as one tick, as published wrappers do, is wrong there.

    `cameras` maps the name of each `CameraSpec` of the agent to its `Image`. `truth` is None for every agent but those
    that declare `privileged = True`.
    """

    tick: int
    gps: Gps
    compass: Compass
    imu: Imu
    speed: Speed
    cameras: Mapping[str, Image] = field(default_factory=dict)
    truth: GroundTruth | None = None

    def signal_problem(self) -> str | None:
        """Return what is wrong with a signal, images aside (`"gps.x_m is nan, expected a finite number"`), or None."""
        gps, compass, imu, speed, finite = self.gps, self.compass, self.imu, self.speed, math.isfinite
        try:
            if (
                (type(gps) is Gps and type(compass) is Compass and type(imu) is Imu and type(speed) is Speed)
                and (finite(gps.x_m) and finite(gps.y_m) and finite(compass.heading_rad) and finite(speed.mps))
                and (finite(imu.forward_mps2) and finite(imu.right_mps2) and finite(imu.yaw_rate_radps))
                and (finite(gps.tick) and finite(compass.tick) and finite(imu.tick) and finite(speed.tick))
            ):
                return None  # the fast way: called in every tick, and nearly every observation is valid
        except (OverflowError, TypeError, ValueError):
            pass  # the loop below names the signal
        for name, kind in (("gps", Gps), ("compass", Compass), ("imu", Imu), ("speed", Speed)):
            signal = getattr(self, name)
            if not isinstance(signal, kind):
                return f"{name} is {signal!r}, expected a {kind.__name__}"
            for part in fields(signal):
                value: object = getattr(signal, part.name)
                if not _is_finite(value):
                    return f"{name}.{part.name} is {value!r}, expected a finite number"
        return None

    def map_images(self, change: Callable[[str, Image], Image]) -> Observation:
        """Return a copy whose images are `change(camera name, image)`; the originals are not touched."""
        return replace(self, cameras={name: change(name, image) for name, image in self.cameras.items()})

    def private(self) -> Observation:
        """Return a copy for the agent: pixels and truth share no memory with the original, but for the lane map."""
        cameras = {name: Image(image.pixels.copy(), image.tick) for name, image in self.cameras.items()}
        return replace(self, cameras=cameras, truth=None if self.truth is None else self.truth.private())


def _is_finite(value: object) -> bool:
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        return False
