"""Weight frames for training: rare and important frames are visited more often, standing frames less often.

A drive is mostly lane following and waiting. Frames are put into buckets as in SimLingo's data loader; then each
scenario type gets at least a minimum share. One pass ("epoch") visits every frame about in proportion to its weight.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust import RoadOption
from pytest_drive_robust.jit.arrays import Floats, Ints

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["NEEDS", "bucket_weights", "draw_epoch", "level_types"]

NEEDS = ("command", "controls", "future", "speed", "tag")
"""The columns of a sample that its weight depends on."""

_STANDING, _STARTING, _BRAKING, _TURNING, _CHANGING = 0.4, 4.0, 2.0, 2.0, 2.5
_STILL_MPS, _MOVED_M = 0.5, 0.5
_FLOOR = 0.02
_LANE_CHANGES = (int(RoadOption.CHANGE_LANE_LEFT), int(RoadOption.CHANGE_LANE_RIGHT))


def bucket_weights(columns: Mapping[str, NDArray[Any]]) -> Floats:
    """Return (n,) weights of frames, about 1: the largest weight of a frame's buckets; less for frames that stand."""
    speed = columns["speed"].astype(np.float64)
    future = columns["future"].astype(np.float64)
    moved = np.hypot(future[:, -1, 0], future[:, -1, 1])
    in_two_s = future[:, 7, 3]
    weights = np.ones(len(speed))
    braking = (columns["controls"][:, :3, 2].max(axis=1) > 0.2) & (speed > 1.0)
    turning = np.abs(future[:, -1, 2]) > 0.35
    changing = np.isin(columns["command"], _LANE_CHANGES).any(axis=1)
    starting = (speed < _STILL_MPS) & (in_two_s > 1.0)
    for chosen, weight in ((braking, _BRAKING), (turning, _TURNING), (changing, _CHANGING), (starting, _STARTING)):
        weights[chosen] = np.maximum(weights[chosen], weight)
    weights[(speed < _STILL_MPS) & (moved < _MOVED_M)] = _STANDING
    return weights


def level_types(weights: Floats, tags: NDArray[Any]) -> Floats:
    """Return weights that sum to one, with the share of every scenario type raised to at least `_FLOOR`.

    With k types the floor is at most 0.9 / k. Types above the floor are reduced in proportion to their share.
    """
    kinds, of = np.unique(tags, return_inverse=True)
    shares = np.bincount(of, weights=weights, minlength=len(kinds)) / weights.sum()
    least = min(_FLOOR, 0.9 / len(kinds))
    wanted = shares.copy()
    low = wanted < least
    while True:
        wanted = np.where(low, least, shares * (1.0 - least * low.sum()) / max(shares[~low].sum(), 1e-12))
        fallen = low | (wanted < least)
        if (fallen == low).all():
            break
        low = fallen
    leveled: Floats = weights / weights.sum() * (wanted / np.maximum(shares, 1e-300))[of]
    leveled /= leveled.sum()
    return leveled


def draw_epoch(weights: Floats, generator: np.random.Generator) -> Ints:
    """Return (n,) row numbers in random order: each row comes `n * weight` times, rounded up or down by chance."""
    count = len(weights)
    edges = np.cumsum(weights) * count / weights.sum()
    edges[-1] = count  # rounding must not lose the last row
    marks = np.arange(count) + generator.random()
    rows = np.minimum(np.searchsorted(edges, marks, side="right"), count - 1)
    generator.shuffle(rows)
    return rows.astype(np.int64)
