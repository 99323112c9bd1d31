"""Read the list of an agent's `sensors()`: cameras for the simulator to draw, other sensors for us to compute."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.errors import UnknownNameError, UsageError

CAMERA = "sensor.camera.rgb"
GNSS = "sensor.other.gnss"
IMU = "sensor.other.imu"
LIDAR = "sensor.lidar.ray_cast"
MAP = "sensor.opendrive_map"
RADAR = "sensor.other.radar"
SPEEDOMETER = "sensor.speedometer"
_SIGNALS: Mapping[str, tuple[str, ...]] = {
    CAMERA: ("cameras",),
    GNSS: ("gps",),
    IMU: ("compass", "imu"),
    LIDAR: (),
    MAP: (),
    RADAR: (),
    SPEEDOMETER: ("speed",),
}
"""Every sensor type that the leaderboard allows, with the signals of ours that it needs."""
_PLACE = ("x", "y", "z", "roll", "pitch", "yaw")
_CAMERA_NUMBERS = ("width", "height", "fov")
_RADAR_NUMBERS = ("horizontal_fov", "vertical_fov")
_OURS = {"x": "x_m", "y": "y_m", "z": "z_m", "pitch": "pitch_deg", "yaw": "yaw_deg"}
"""The leaderboard's and our names for the place of a sensor; no sensor has a roll."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor: metres forward, right and up of the vehicle's centre on the ground, degrees as in CARLA."""

    type: str
    id: str
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    horizontal_fov_deg: float = 30.0
    vertical_fov_deg: float = 30.0


@dataclass(frozen=True, slots=True)
class OfficialRig:
    """Sensors in the agent's order, and cameras for the simulator; a camera has the same name in both."""

    sensors: tuple[Sensor, ...]
    cameras: tuple[CameraSpec, ...]

    @property
    def consumes(self) -> frozenset[str]:
        """The signals of ours that reach the agent."""
        return frozenset(signal for sensor in self.sensors for signal in _SIGNALS[sensor.type])

    @property
    def needs_truth(self) -> bool:
        """True when a sensor (lidar, radar, map) is computed from the world's state, as our worlds have none."""
        return any(sensor.type in (LIDAR, RADAR, MAP) for sensor in self.sensors)


def read_rig(specs: object, *, agent: str) -> OfficialRig:
    """Return the rig of the list `specs` that `sensors()` of `agent` gave. Raises `UsageError` that names the sensor.

    As in the leaderboard, every sensor measures in every tick, whatever `sensor_tick` and `reading_frequency` say.
    """
    if not isinstance(specs, Sequence) or isinstance(specs, str):
        raise UsageError(f"sensors() of {agent} returned {specs!r}, expected a list of dictionaries.")
    sensors: list[Sensor] = []
    cameras: list[CameraSpec] = []
    for spec in specs:
        numbers = _numbers_of(spec, agent)
        name, kind = str(spec["id"]), str(spec["type"])
        if any(sensor.id == name for sensor in sensors):
            raise UsageError(f"sensors() of {agent} returned two sensors with the id {name!r}, expected distinct ids.")
        place: dict[str, Any] = {ours: numbers[theirs] for theirs, ours in _OURS.items()}
        fields = {f"{field}_deg": numbers[field] for field in _RADAR_NUMBERS if field in numbers}
        sensors.append(Sensor(kind, name, **place, **fields))
        if kind == CAMERA:
            width_px, height_px = int(numbers["width"]), int(numbers["height"])
            camera = CameraSpec(name, fov_deg=numbers["fov"], width_px=width_px, height_px=height_px)
            cameras.append(replace(camera, **place))
    return OfficialRig(tuple(sensors), tuple(cameras))


def _numbers_of(spec: object, agent: str) -> dict[str, float]:
    """Return every number of one specification; missing numbers of its place are 0. Raises `UsageError`."""
    if not isinstance(spec, Mapping) or "type" not in spec or "id" not in spec:
        raise UsageError(f"sensors() of {agent} returned {spec!r}, expected a dictionary with 'type' and 'id'.")
    kind, what = spec["type"], f"the sensor {spec['id']!r} of {agent}"
    if kind not in _SIGNALS:
        error = UnknownNameError.of("sensor type", str(kind), _SIGNALS, hint=f"It is asked for as {spec['id']!r}")
        raise UnknownNameError(f"{error} by {agent}.")
    needed = {CAMERA: _CAMERA_NUMBERS, RADAR: _RADAR_NUMBERS}.get(kind, ())
    numbers = {field: _number(spec.get(field, 0.0), field, what) for field in _PLACE}
    numbers.update({field: _number(spec.get(field), field, what) for field in needed})
    tilted = ("roll", "pitch") if kind == IMU else ("roll",)
    for field in tilted:
        if numbers[field] != 0.0 and kind in (CAMERA, IMU, LIDAR, RADAR):
            raise UsageError(f"{what} has a {field} of {numbers[field]:g} degrees, expected 0: ours stand upright.")
    return numbers


def _number(given: Any, field: str, what: str) -> float:
    try:
        number = float(given)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise UsageError(f"{what} has {field!r}: {given!r}, expected a number.")
    return number
