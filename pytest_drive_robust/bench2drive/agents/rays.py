"""Where rays in a fan of directions meet standing boxes and flat ground: what lidar and radar share.

The world is flat, and everything in it is an upright box. So each direction seen from above is cut with the boxes
once, and heights decide afterwards, for all rays of that direction together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, WorldState

__all__ = ["Boxes", "boxes_near", "first_hits", "sensor_pose"]

Floats = NDArray[np.float64]
Boxes = tuple[Floats, Floats]
"""(k, 6) of x, y, yaw, length, width, height in metres and radians, and (k, 2) velocities in m/s."""

_FLAT = (ActorKind.DIRT,)


def sensor_pose(truth: GroundTruth, *, x_m: float, y_m: float, yaw_deg: float) -> tuple[float, float, float]:
    """Return (x, y, yaw) in the world of a sensor that is mounted on the ego."""
    ego = truth.frame.ego
    cos, sin = np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)
    return ego.x_m + x_m * cos - y_m * sin, ego.y_m + x_m * sin + y_m * cos, ego.yaw_rad + np.radians(yaw_deg)


def boxes_near(truth: GroundTruth, x_m: float, y_m: float, *, reach_m: float) -> Boxes:
    """Return every actor and building of which a part may be within reach of a point."""
    actors = truth.frame.actors
    actors = actors[~np.isin(actors[:, WorldState.KIND], _FLAT)]
    columns = [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT]
    along = np.stack([np.cos(actors[:, WorldState.YAW]), np.sin(actors[:, WorldState.YAW])], axis=1)
    moving = along * actors[:, WorldState.SPEED, None]
    buildings = np.asarray(truth.lane_map.buildings).reshape(-1, 6)
    boxes = np.concatenate([actors[:, columns], buildings])
    velocities = np.concatenate([moving, np.zeros((len(buildings), 2))])
    distance = np.hypot(boxes[:, 0] - x_m, boxes[:, 1] - y_m) - 0.5 * np.hypot(boxes[:, 3], boxes[:, 4])
    near = distance < reach_m
    return boxes[near], velocities[near]


def first_hits(
    pose: tuple[float, float, float], z_m: float, azimuths: Floats, slopes: Floats, boxes: Floats, *, reach_m: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return how far rays fly in the plane, and what they meet: (azimuths, slopes) each.

    `azimuths` are radians to the right of the sensor, `slopes` metres up per metre forward, of as many rays for each
    azimuth: (m,) for all alike or (n, m). The number of the box is -1 for the ground and -2 for nothing within reach.
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
        reaches = np.where(at_near <= height, near, np.inf)  # its side; from above, its roof
        falling = (at_near > height) & (z_m + slope * far <= height)
        np.divide(height - z_m, slope, out=reaches, where=falling)
        closer = (reaches < flat[ray]) & (at_near >= 0.0)
        flat[ray] = np.where(closer, reaches, flat[ray])
        met[ray] = np.where(closer, box, met[ray])
    beyond = flat * np.sqrt(1.0 + slopes**2) > reach_m
    met[beyond] = -2
    return flat, met


def _crossings(pose: tuple[float, float, float], azimuths: Floats, boxes: Floats) -> tuple[Floats, Floats]:
    """Return (azimuths, boxes): metres from the sensor to where a line enters and leaves each box; inf if never."""
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
