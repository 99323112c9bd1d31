"""Samples for `simlingo`: cars on circles of made-up worlds, and a network small enough to be trained in a test."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.simlingo import SimLingoSpec
from drive_robust_agents.training.data.facts import FACTS

SMALL = SimLingoSpec(height_px=64, width_px=64, kept_px=48, stem=8, widths=(16, 32), model=64, layers=2, hidden=128)

FREE = {
    "light": -1.0, "light_m": 100.0, "lead_m": 100.0, "lead_mps": 0.0, "walker_m": 100.0, "obstacle_m": 100.0,
    "junction_m": 100.0, "lane_width_m": 3.5, "lane_left": 0.0, "lane_right": 0.0, "limit_mps": 14.0, "night": 0.0,
    "wish_mps2": 0.0, "passing": 0.0, "waiting": 0.0, "siren": 0.0,
}  # fmt: skip
"""Facts of an empty road."""


def samples(rows: int, *, spec: SimLingoSpec = SMALL, seed: int = 0) -> dict[str, NDArray[Any]]:
    """Make constant accelerations on circles, with lanes on both sides; every image is a pattern of its own."""
    generator = np.random.default_rng(seed)
    speed = generator.uniform(4.0, 10.0, rows)
    seconds, metres = 0.25 * np.arange(1.0, 13.0), np.arange(1.0, 25.0)
    speeds = np.maximum(speed[:, None] + generator.uniform(-1.0, 1.0, (rows, 1)) * seconds, 0.0)
    driven = np.cumsum(0.25 * speeds, axis=1)
    bend = generator.normal(0.0, 0.01, (rows, 1))
    cells = generator.integers(0, 256, (rows, 4, 4, 3), dtype=np.uint8)
    image = cells.repeat(spec.height_px // 4, axis=1).repeat(spec.width_px // 4, axis=2)
    facts = FREE | {"lane_left": 1.0, "lane_right": 1.0}
    return {
        "cam_front": image,
        "speed": speed.astype(np.float32),
        "target": np.tile(np.array([[20.0, 0.0], [40.0, 0.0]], np.float32), (rows, 2, 1, 1)),
        "command": np.full((rows, 2), 4, np.int8),
        "future": np.stack([driven, 0.5 * bend * driven**2, bend * driven, speeds], axis=2).astype(np.float32),
        "future_ok": np.ones((rows, 12), dtype=bool),
        "path": np.stack([np.tile(metres, (rows, 1)), 0.5 * bend * metres**2], axis=2).astype(np.float32),
        "facts": np.tile(np.array([facts[name] for name in FACTS], np.float32), (rows, 1)),
        "episode": np.arange(rows, dtype=np.int32),
        "tag": np.zeros(rows, np.int16),
        "source": np.zeros(rows, np.int8),
        "tick": np.zeros(rows, np.int32),
    }
