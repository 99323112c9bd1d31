"""Made-up samples for the agents with six cameras: a car ahead on a straight road; colours tell speed and gap."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._wrappers.bev_agent import CAMERAS
from pytest_drive_robust.domain.truth import ActorKind

Arrays = dict[str, NDArray[Any]]


def bev_samples(count: int, *, seed: int = 0) -> Arrays:
    """Make training samples by the contract, every second with the frame 0.5 s before; brighter means faster."""
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.0, 10.0, count).astype(np.float32)
    gap = rng.uniform(8.0, 40.0, count).astype(np.float32)
    seconds = 0.25 * np.arange(1, 13)
    future = np.zeros((count, 12, 4), dtype=np.float32)
    future[..., 0], future[..., 3] = speed[:, None] * seconds, speed[:, None]
    boxes = np.zeros((count, 24, 9), dtype=np.float32)
    boxes[:, 0] = [0.0, 0.0, 0.0, 1.0, 4.6, 1.9, 0.0, ActorKind.CAR, 1.0]
    boxes[:, 0, 0] = gap
    box_future = np.full((count, 24, 6, 2), np.nan, dtype=np.float32)
    box_future[:, 0] = boxes[:, None, 0, :2]
    lanes = np.full((count, 12, 6, 2), np.nan, dtype=np.float32)
    lane_kind = np.full((count, 12), -1, dtype=np.int8)
    for number, (right_m, kind) in enumerate(((0.0, 0), (-3.5, 1), (1.75, 3))):
        lanes[:, number] = np.stack([np.linspace(-16.0, 64.0, 6), np.full(6, right_m)], axis=-1)
        lane_kind[:, number] = kind
    arrays: Arrays = {
        "speed": speed,
        "imu": np.zeros((count, 3), dtype=np.float32),
        "pose": np.column_stack([speed * 0.5, np.zeros((count, 2))]).astype(np.float32),
        "command": np.repeat(rng.integers(1, 7, (count, 1)), 2, axis=1).astype(np.int8),
        "future": future,
        "future_ok": np.ones((count, 12), dtype=np.bool_),
        "boxes": boxes,
        "box_future": box_future,
        "lanes": lanes,
        "lane_kind": lane_kind,
        "facts": _facts(gap),
        "source": np.zeros(count, dtype=np.int8),
        "old_ok": np.arange(count) % 2 == 0,
        "old_speed": speed,
        "old_imu": np.zeros((count, 3), dtype=np.float32),
        "old_pose": np.zeros((count, 3), dtype=np.float32),
    }
    for camera in CAMERAS:
        images = rng.integers(0, 40, (count, camera.height_px, camera.width_px, 3), dtype=np.uint8)
        images[..., 0] += (speed * 20.0).astype(np.uint8)[:, None, None]
        images[..., 1] += (gap * 5.0).astype(np.uint8)[:, None, None]
        arrays[f"cam_{camera.name}"] = images
        arrays[f"old_cam_{camera.name}"] = images.copy()
    return arrays


def _facts(gap: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return no light, a leader at the gap, nothing else within 100 m."""
    facts = np.full((len(gap), 16), 100.0, dtype=np.float32)
    facts[:, 0], facts[:, 2] = -1.0, gap
    return facts
