"""Small sets of training frames made of noise and simple geometry, in the format that `collect` writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.data.frames import write_shard

Row = Mapping[str, NDArray[Any]]


def made_row(generator: np.random.Generator, *, episode: int, tick: int, cameras: Mapping[str, tuple[int, int]]) -> Row:
    """Make a car that drives a circle; the first rows of every image are as bright as it is fast."""
    speed, curvature = generator.uniform(0.0, 12.0), generator.uniform(-0.05, 0.05)
    way = speed * np.arange(1, 13) * 0.25
    future = np.stack([way, 0.5 * curvature * way**2, curvature * way, np.full(12, speed)], axis=1)
    images = {f"cam_{name}": generator.integers(0, 256, (*size, 3), dtype=np.uint8) for name, size in cameras.items()}
    for image in images.values():
        image[: len(image) // 2] = int(speed * 20.0)
    metres = np.arange(1.0, 25.0)
    return images | {
        "speed": np.float32(speed),
        "imu": np.zeros(3, np.float32),
        "pose": np.array([tick * 0.05 * speed, 0.0, 0.0]),
        "command": np.full(2, generator.integers(1, 7), np.int8),
        "target": np.tile(np.array([20.0, 200.0 * curvature], np.float32), (2, 2, 1)),
        "future": future.astype(np.float32),
        "future_ok": np.arange(12) < 10,
        "path": np.stack([metres, 0.5 * curvature * metres**2], axis=1).astype(np.float32),
        "controls": np.tile(np.array([0.5, 10.0 * curvature, 0.0], np.float32), (5, 1)),
        "gap": np.array([generator.uniform(5.0, 100.0), speed], np.float32),
        "boxes": np.zeros((24, 9), np.float32),
        "box_future": np.full((24, 6, 2), np.nan, np.float32),
        "lanes": np.full((12, 6, 2), np.nan, np.float32),
        "lane_kind": np.full(12, -1, np.int8),
        "facts": np.full(16, -1.0, np.float32),
        "tag": np.int16(episode % 3),
        "source": np.int8(0),
        "episode": np.int32(episode),
        "tick": np.int32(tick),
    }  # fmt: skip


def write_frames(
    folder: Path,
    *,
    rows: int,
    cameras: Mapping[str, tuple[int, int]],
    episodes: int = 8,
    shards: int = 2,
    seed: int = 0,
) -> Path:
    """Write `rows` frames of `episodes` drives, one every five ticks; cameras by name with (height, width)."""
    generator = np.random.Generator(np.random.Philox(seed))
    made: Sequence[Row] = [
        made_row(generator, episode=k * episodes // rows, tick=5 * (k % -(-rows // episodes)), cameras=cameras)
        for k in range(rows)
    ]
    for number in range(shards):
        part = made[number * rows // shards : (number + 1) * rows // shards]
        write_shard(folder, number, part, {"routes": [], "seed": seed})
    return folder
