"""Deployment failures of network inputs for `train --robust`, in some rows of a batch.

Labels stay true, so that a network learns correct outputs for wrong inputs. Equal generators give equal failures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.recipes.augment import occlude
from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["MOST_HIDDEN", "gps_errors", "hang", "late", "misread", "muddy"]

Floats32 = NDArray[np.float32]

MOST_HIDDEN = 0.85
"""Largest hidden share of either side of an image; the paper hides up to 0.8."""

_SHARE = 1.0 / 3.0
"""Share of rows with each failure; mud is in every second row."""

_MOST_GPS_M = 15.0
_HANGS = 0.4
"""Share of cameras that repeat an old picture in an affected row: about as many as in bursts of 3 s."""


def gps_errors(rows: int, generator: np.random.Generator) -> Floats:
    """Return position errors (rows, 2) in metres, with a deviation of 0 to 15 m, equal in both directions."""
    deviation = generator.uniform(0.0, _MOST_GPS_M, (rows, 1)) * (generator.random((rows, 1)) < _SHARE)
    errors: Floats = deviation * generator.standard_normal((rows, 2))
    return errors


def misread(speed: Floats32, generator: np.random.Generator) -> Floats32:
    """Return measured speeds: for some rows a fraction of the true speed, about 0.2 to 1, and some noise.

    Speeds are (N,), or (ticks, N): the fraction belongs to the row, the noise to the reading.
    """
    rows = speed.shape[-1]
    factor = generator.uniform(0.2, 1.0, rows) + 0.2 * generator.standard_normal(speed.shape)
    return np.where(generator.random(rows) < _SHARE, factor * speed, speed).astype(np.float32)


def muddy(images: Pixels, old_images: Pixels, generator: np.random.Generator) -> None:
    """Black out a rectangle in every camera of every second row (N, cameras, H, W, 3), each at its own place.

    The old picture gets another rectangle, because the paper's occlusion moves in every tick. Both pictures are changed
    in place.
    """
    rows = generator.random(len(images)) < 0.5
    for pictures in (images, old_images):
        seen = pictures[rows]
        occlude(seen, generator, chance=1.0, most=MOST_HIDDEN)
        pictures[rows] = seen


def hang(images: Pixels, old_images: Pixels, known: NDArray[np.bool_], generator: np.random.Generator) -> None:
    """Let some cameras of some rows (N, cameras, H, W, 3) show the old picture, in rows where it is `known`."""
    rows, cameras = images.shape[:2]
    hung = (generator.random((rows, cameras)) < _HANGS) & ((generator.random(rows) < _SHARE) & known)[:, None]
    images[hung] = old_images[hung]


def late(future: Floats32, generator: np.random.Generator) -> Floats32:
    """Return the expert's drive (N, 12, 4), for some rows in the later ego frame in which a delayed control arrives.

    The delay is one or two columns (0.25 or 0.5 s); positions and yaw are relative to the car at that time. The last
    columns, which were not driven, repeat the last step.
    """
    shifted: Floats32 = future.copy()
    rows = np.nonzero(generator.random(len(future)) < _SHARE)[0]
    for row, delay in zip(rows, generator.integers(1, 3, len(rows)), strict=True):
        shifted[row] = _seen_later(future[row], int(delay))
    return shifted


def _seen_later(future: Floats32, delay: int) -> Floats32:
    """Return (12, 4): the drive from the pose in column `delay - 1`, in that pose's frame."""
    x, y, yaw, _ = future[delay - 1]
    ahead = np.concatenate([future[delay:], np.repeat(future[-1:], delay, axis=0)])
    ahead[-delay:, :2] += np.arange(1, delay + 1)[:, None] * (future[-1, :2] - future[-2, :2])
    away = ahead[:, :2] - (x, y)
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = (cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0])
    seen: Floats32 = np.stack([*turned, ahead[:, 2] - yaw, ahead[:, 3]], axis=1).astype(np.float32)
    return seen
