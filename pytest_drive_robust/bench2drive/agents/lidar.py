"""`sensor.lidar.ray_cast` of the leaderboard, from the state of the world: upright boxes and flat ground.

The leaderboard's lidar has 64 channels from 10 degrees above to 30 below the horizon, 600,000 points a second, 10 turns
a second and 85 m of reach (Bench2Drive `leaderboard/autoagents/agent_wrapper.py`). At 20 Hz a tick sees half a turn:
even ticks the right half, odd ticks the left. Ours loses no points at random, and rays that meet nothing give none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.bench2drive.agents.rays import boxes_near, first_hits, sensor_pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.bench2drive.agents.official_rig import Sensor
    from pytest_drive_robust.domain.truth import GroundTruth

__all__ = ["sweep"]

_CHANNELS = 64
_LOWEST_DEG, _HIGHEST_DEG = -30.0, 10.0
_REACH_M = 85.0
_AZIMUTHS = 600_000 // 20 // _CHANNELS
_ATTENUATION_PER_M = 0.004


def sweep(sensor: Sensor, truth: GroundTruth) -> NDArray[np.float32]:
    """Return (n, 4) points of this tick: metres forward, right and up of the sensor, and intensity 0..1."""
    pose = sensor_pose(truth, x_m=sensor.x_m, y_m=sensor.y_m, yaw_deg=sensor.yaw_deg)
    boxes, _ = boxes_near(truth, *pose[:2], reach_m=_REACH_M)
    start = 0.0 if truth.frame.tick % 2 == 0 else np.pi
    azimuths = start + np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    slopes = np.tan(np.radians(np.linspace(_LOWEST_DEG, _HIGHEST_DEG, _CHANNELS) + sensor.pitch_deg))
    flat, met = first_hits(pose, sensor.z_m, azimuths, slopes, boxes, reach_m=_REACH_M)
    ray, channel = np.nonzero(met > -2)
    away = flat[ray, channel]
    forward, right, up = away * np.cos(azimuths[ray]), away * np.sin(azimuths[ray]), away * slopes[channel]
    intensity = np.exp(-_ATTENUATION_PER_M * np.sqrt(away**2 + up**2))
    return np.stack([forward, right, up, intensity], axis=1).astype(np.float32)
