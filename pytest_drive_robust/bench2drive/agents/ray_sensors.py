"""`sensor.lidar.ray_cast` and `sensor.other.radar` of the leaderboard, from the state of the world.

The world is flat, and everything in it is an upright box. So each direction seen from above is intersected with the
boxes once; then heights decide for all rays of this direction together.

The leaderboard's lidar has 64 channels from 10 degrees above to 30 below the horizon, 600,000 points a second, 10 turns
a second and 85 m of reach; its radar 1,500 rays a second and 100 m (Bench2Drive
`leaderboard/autoagents/agent_wrapper.py`). At 20 Hz a tick sees half a turn of the lidar: even ticks the right half,
odd ticks the left. Our lidar loses no points at random, and a ray that meets nothing gives no point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.bench2drive.agents.official_rig import Sensor
from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, WorldState
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.perturbations.context import Draws

_CHANNELS = 64
_LOWEST_DEG, _HIGHEST_DEG = -30.0, 10.0
_LIDAR_REACH_M = 85.0
_AZIMUTHS = 600_000 // 20 // _CHANNELS
_ATTENUATION_PER_M = 0.004
_RADAR_RAYS = 1500 // 20
_RADAR_REACH_M = 100.0


def sweep(sensor: Sensor, truth: GroundTruth) -> NDArray[np.float32]:
    """Return (n, 4) points of this tick: metres forward, right and up of the sensor, and intensity 0..1."""
    pose = _pose(sensor, truth)
    boxes, _ = _boxes_near(truth, *pose[:2], reach_m=_LIDAR_REACH_M)
    start = 0.0 if truth.state.tick % 2 == 0 else np.pi
    azimuths = start + np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    slopes = np.tan(np.radians(np.linspace(_LOWEST_DEG, _HIGHEST_DEG, _CHANNELS) + sensor.pitch_deg))
    flat, met = _first_hits(pose, sensor.z_m, azimuths, slopes, boxes, reach_m=_LIDAR_REACH_M)
    ray, channel = np.nonzero(met > -2)
    away = flat[ray, channel]
    forward, right, up = away * np.cos(azimuths[ray]), away * np.sin(azimuths[ray]), away * slopes[channel]
    intensity = np.exp(-_ATTENUATION_PER_M * np.sqrt(away**2 + up**2))
    return np.stack([forward, right, up, intensity], axis=1).astype(np.float32)


def detections(sensor: Sensor, truth: GroundTruth, draws: Draws) -> NDArray[np.float32]:
    """Return (n, 4): depth in m, altitude and azimuth in radians, velocity towards the sensor negative, in m/s.

    The directions of the rays are drawn within the elliptic field of view; a ray that meets nothing gives no detection.
    """
    tick, ego = truth.state.tick, truth.state.ego
    pose = _pose(sensor, truth)
    boxes, velocities = _boxes_near(truth, *pose[:2], reach_m=_RADAR_REACH_M)
    drawn = np.array([draws.uniform(f"{sensor.id} ray {ray}", tick)[:2] for ray in range(_RADAR_RAYS)])
    radius, angle = np.sqrt(drawn[:, 0]), 2.0 * np.pi * drawn[:, 1]
    azimuths = radius * np.cos(angle) * np.radians(sensor.horizontal_fov_deg) / 2.0
    altitudes = radius * np.sin(angle) * np.radians(sensor.vertical_fov_deg) / 2.0
    slopes = np.tan(altitudes + np.radians(sensor.pitch_deg))[:, None]
    flat, met = _first_hits(pose, sensor.z_m, azimuths, slopes, boxes, reach_m=_RADAR_REACH_M)
    seen = np.flatnonzero(met[:, 0] > -2)
    away, box, slope = flat[seen, 0], met[seen, 0], slopes[seen, 0]
    own = ego.speed_mps * np.array([np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)])
    moving = np.concatenate([velocities, np.zeros((1, 2))])[box] - own  # -1, the ground, takes the last row: velocity 0
    along = np.stack([np.cos(pose[2] + azimuths[seen]), np.sin(pose[2] + azimuths[seen])], axis=1)
    velocity = (moving * along).sum(axis=1) / np.sqrt(1.0 + slope**2)
    depth = away * np.sqrt(1.0 + slope**2)
    return np.stack([depth, altitudes[seen], azimuths[seen], velocity], axis=1).astype(np.float32)


def _pose(sensor: Sensor, truth: GroundTruth) -> tuple[float, float, float]:
    """Return (x, y, yaw) in the world of a sensor that is mounted on the ego."""
    ego = truth.state.ego
    cos, sin = np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)
    x_m = ego.x_m + sensor.x_m * cos - sensor.y_m * sin
    y_m = ego.y_m + sensor.x_m * sin + sensor.y_m * cos
    return x_m, y_m, ego.yaw_rad + np.radians(sensor.yaw_deg)


def _boxes_near(truth: GroundTruth, x_m: float, y_m: float, *, reach_m: float) -> tuple[Floats, Floats]:
    """Return every actor and building that may be partly within reach of a point.

    The boxes are (k, 6): x, y, yaw, length, width, height in metres and radians. The velocities are (k, 2) in m/s.
    """
    actors = truth.state.actors
    actors = actors[actors[:, WorldState.KIND] != ActorKind.DIRT]
    columns = [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT]
    along = np.stack([np.cos(actors[:, WorldState.YAW]), np.sin(actors[:, WorldState.YAW])], axis=1)
    moving = along * actors[:, WorldState.SPEED, None]
    buildings = np.asarray(truth.lane_map.buildings).reshape(-1, 6)
    boxes = np.concatenate([actors[:, columns], buildings])
    velocities = np.concatenate([moving, np.zeros((len(buildings), 2))])
    distance = np.hypot(boxes[:, 0] - x_m, boxes[:, 1] - y_m) - 0.5 * np.hypot(boxes[:, 3], boxes[:, 4])
    near = distance < reach_m
    return boxes[near], velocities[near]


def _first_hits(
    pose: tuple[float, float, float], z_m: float, azimuths: Floats, slopes: Floats, boxes: Floats, *, reach_m: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return the horizontal distance in metres at which each ray meets something, and the number of the box: (n, m).

    `azimuths` (n,) are radians to the right of the sensor, `slopes` metres up per metre forward: (m,) for every azimuth
    alike, or (n, m). The number of the box is -1 for the ground and -2 for nothing within reach.
    """
    slopes = np.broadcast_to(slopes, (len(azimuths), slopes.shape[-1]))
    flat = np.full(slopes.shape, np.inf)
    np.divide(-z_m, slopes, out=flat, where=slopes < 0.0)
    met = np.where(np.isfinite(flat), -1, -2)
    enters, leaves = _crossings(pose, azimuths, boxes)
    for ray, box in zip(*np.nonzero(enters < np.minimum(leaves, reach_m)), strict=True):
        near, far, height = enters[ray, box], leaves[ray, box], boxes[box, 5]
        slope = slopes[ray]
        at_near = z_m + slope * near
        reaches = np.where(at_near <= height, near, np.inf)  # the side of the box; a ray from above meets the roof
        falling = (at_near > height) & (z_m + slope * far <= height)
        np.divide(height - z_m, slope, out=reaches, where=falling)
        closer = (reaches < flat[ray]) & (at_near >= 0.0)
        flat[ray] = np.where(closer, reaches, flat[ray])
        met[ray] = np.where(closer, box, met[ray])
    beyond = flat * np.sqrt(1.0 + slopes**2) > reach_m
    met[beyond] = -2
    return flat, met


def _crossings(pose: tuple[float, float, float], azimuths: Floats, boxes: Floats) -> tuple[Floats, Floats]:
    """Return two tables (azimuths, boxes): metres to where a ray enters a box (inf if never) and where it leaves."""
    x, y, yaw = pose
    dx, dy = np.cos(yaw + azimuths)[:, None], np.sin(yaw + azimuths)[:, None]
    cos, sin = np.cos(boxes[:, 2]), np.sin(boxes[:, 2])
    from_x, from_y = x - boxes[:, 0], y - boxes[:, 1]
    starts = (from_x * cos + from_y * sin, from_y * cos - from_x * sin)
    steps = (dx * cos + dy * sin, dy * cos - dx * sin)
    enters, leaves = np.zeros((len(azimuths), len(boxes))), np.full((len(azimuths), len(boxes)), np.inf)
    for start, step, size in zip(starts, steps, (boxes[:, 3], boxes[:, 4]), strict=True):
        step = np.where(np.abs(step) < 1e-12, 1e-12, step)
        one, other = (-0.5 * size - start) / step, (0.5 * size - start) / step
        enters = np.maximum(enters, np.minimum(one, other))
        leaves = np.minimum(leaves, np.maximum(one, other))
    return np.where(enters < leaves, enters, np.inf), leaves
