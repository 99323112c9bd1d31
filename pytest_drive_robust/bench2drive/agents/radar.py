"""`sensor.other.radar` of the leaderboard, from the state of the world: 1,500 rays a second, 100 m of reach."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.bench2drive.agents.rays import boxes_near, first_hits, sensor_pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.bench2drive.agents.official_rig import Sensor
    from pytest_drive_robust.domain.truth import GroundTruth
    from pytest_drive_robust.perturbations.draws import Draws

__all__ = ["detections"]

_RAYS = 1500 // 20
_REACH_M = 100.0


def detections(sensor: Sensor, truth: GroundTruth, draws: Draws) -> NDArray[np.float32]:
    """Return (n, 4): depth in m, altitude and azimuth in radians, velocity towards the sensor negative, in m/s.

    Rays leave in directions drawn within the elliptic field of view; those that meet nothing give no detection.
    """
    tick, ego = truth.frame.tick, truth.frame.ego
    pose = sensor_pose(truth, x_m=sensor.x_m, y_m=sensor.y_m, yaw_deg=sensor.yaw_deg)
    boxes, velocities = boxes_near(truth, *pose[:2], reach_m=_REACH_M)
    drawn = np.array([draws.uniform(f"{sensor.id} ray {ray}", tick)[:2] for ray in range(_RAYS)])
    radius, angle = np.sqrt(drawn[:, 0]), 2.0 * np.pi * drawn[:, 1]
    azimuths = radius * np.cos(angle) * np.radians(sensor.horizontal_fov_deg) / 2.0
    altitudes = radius * np.sin(angle) * np.radians(sensor.vertical_fov_deg) / 2.0
    slopes = np.tan(altitudes + np.radians(sensor.pitch_deg))[:, None]
    flat, met = first_hits(pose, sensor.z_m, azimuths, slopes, boxes, reach_m=_REACH_M)
    seen = np.flatnonzero(met[:, 0] > -2)
    away, box, slope = flat[seen, 0], met[seen, 0], slopes[seen, 0]
    own = ego.speed_mps * np.array([np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)])
    moving = np.concatenate([velocities, np.zeros((1, 2))])[box] - own  # -1, the ground, is the row that stands
    along = np.stack([np.cos(pose[2] + azimuths[seen]), np.sin(pose[2] + azimuths[seen])], axis=1)
    velocity = (moving * along).sum(axis=1) / np.sqrt(1.0 + slope**2)
    depth = away * np.sqrt(1.0 + slope**2)
    return np.stack([depth, altitudes[seen], azimuths[seen], velocity], axis=1).astype(np.float32)
