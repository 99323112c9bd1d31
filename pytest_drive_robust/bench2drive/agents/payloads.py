"""An observation as the leaderboard's `input_data`: `{sensor id: (frame, payload)}`.

============================ ======================================================================================
sensor                       payload
============================ ======================================================================================
`sensor.camera.rgb`          uint8 (height, width, 4), BGRA, alpha 255
`sensor.other.gnss`          float64 [latitude in degrees, longitude in degrees, altitude in m]
`sensor.other.imu`           float64 [3 accelerations in m/s2, 3 turn rates in rad/s, compass in rad, 0 = north]
`sensor.speedometer`         {"speed": forward speed in m/s}
`sensor.lidar.ray_cast`      float32 (n, 4): x, y, z in m from the sensor, intensity
`sensor.other.radar`         float32 (n, 4): depth in m, altitude and azimuth in rad, velocity in m/s
`sensor.opendrive_map`       {"opendrive": the map as text}
============================ ======================================================================================

Formats, noise and frame numbers are those of Bench2Drive `leaderboard/envs/sensor_interface.py` and
`leaderboard/autoagents/agent_wrapper.py`. Every payload carries the number of the current frame, also for a stale
image: nothing in the leaderboard tells an agent that its camera hangs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.bench2drive.agents import official_rig
from pytest_drive_robust.bench2drive.agents.opendrive import opendrive_of
from pytest_drive_robust.bench2drive.agents.ray_sensors import detections, sweep
from pytest_drive_robust.domain.geodesy import to_geodetic
from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.perturbations.context import Draws

InputData = dict[str, tuple[int, Any]]

_DT_S = 0.05
_GRAVITY_MPS2 = 9.81
_GNSS_NOISE = 5e-6
"""Standard deviation of latitude and longitude in degrees (0.56 m), and of the altitude in metres."""
_IMU_NOISE = 0.001
_IMU_VERTICAL_NOISE = 0.015
_COMPASS_WAKES = 3
"""The usual number of frames at the start of an episode in which CARLA's compass is NaN."""


def frame_number(tick: int) -> int:
    """Return the number of the frame of a tick, counted from 1 at the start of the route."""
    return tick + 1


def game_time_s(tick: int) -> float:
    """Return seconds since the start of the route at 20 Hz, as the leaderboard counts them: 0.05 in the first step."""
    return frame_number(tick) * _DT_S


class Payloads:
    """The sensors of one episode. Their noise is a function of the seed, the route, the sensor and the tick."""

    def __init__(self, rig: official_rig.OfficialRig, *, seed: int, route: str) -> None:
        self._rig = rig
        self._draws = Draws(seed, route, "leaderboard sensors")
        self._map: str | None = None

    def of(self, observation: Observation) -> InputData:
        """Return the `input_data` of `run_step`; the agent may write to every array."""
        frame = frame_number(observation.tick)
        return {sensor.id: (frame, self._payload(sensor, observation)) for sensor in self._rig.sensors}

    def _payload(self, sensor: official_rig.Sensor, seen: Observation) -> object:
        if sensor.type == official_rig.CAMERA:
            return _bgra(seen.cameras[sensor.id])
        if sensor.type == official_rig.GNSS:
            return self._position(sensor, seen)
        if sensor.type == official_rig.IMU:
            return self._motion(sensor, seen)
        if sensor.type in (official_rig.LIDAR, official_rig.RADAR, official_rig.MAP):
            return self._from_truth(sensor, seen)
        return {"speed": seen.speed.mps}

    def _from_truth(self, sensor: official_rig.Sensor, seen: Observation) -> object:
        truth = seen.truth
        assert truth is not None  # the adapter is privileged when a sensor needs it
        if sensor.type == official_rig.LIDAR:
            return sweep(sensor, truth)
        if sensor.type == official_rig.RADAR:
            return detections(sensor, truth, self._draws)
        if self._map is None:
            self._map = opendrive_of(truth.lane_map)
        return {"opendrive": self._map}

    def _position(self, sensor: official_rig.Sensor, seen: Observation) -> NDArray[np.float64]:
        yaw = seen.compass.yaw_rad
        x_m = seen.gps.x_m + sensor.x_m * math.cos(yaw) - sensor.y_m * math.sin(yaw)
        y_m = seen.gps.y_m + sensor.x_m * math.sin(yaw) + sensor.y_m * math.cos(yaw)
        noise = np.array(self._draws.normal(sensor.id, seen.tick)[:3]) * _GNSS_NOISE
        return np.array([*to_geodetic(x_m, y_m), sensor.z_m]) + noise

    def _motion(self, sensor: official_rig.Sensor, seen: Observation) -> NDArray[np.float64]:
        """Return the data of an IMU that turns with its mount: accelerations along its own axes, its own heading."""
        turn = math.radians(sensor.yaw_deg)
        forward, right = seen.imu.forward_mps2, seen.imu.right_mps2
        ahead = forward * math.cos(turn) + right * math.sin(turn)
        aside = right * math.cos(turn) - forward * math.sin(turn)
        measured = np.array([ahead, aside, _GRAVITY_MPS2, 0.0, 0.0, seen.imu.yaw_rate_radps])
        spread = np.array([_IMU_NOISE, _IMU_NOISE, _IMU_VERTICAL_NOISE, *[_IMU_NOISE] * 3])
        drawn = (*self._draws.normal(sensor.id, seen.tick), *self._draws.normal(f"{sensor.id} turning", seen.tick)[:2])
        compass = (seen.compass.heading_rad + turn) % math.tau if seen.tick >= _COMPASS_WAKES else math.nan
        return np.array([*(measured + spread * np.array(drawn)), compass])


def _bgra(image: Image) -> NDArray[np.uint8]:
    import cv2

    return cv2.cvtColor(image.pixels, cv2.COLOR_RGB2BGRA)  # type: ignore[return-value]
