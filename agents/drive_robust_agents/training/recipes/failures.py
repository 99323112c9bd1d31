"""What deployment does to the inputs of a network, for `train --robust`: some rows of a batch suffer, others do not.

Labels stay those of the truth, so that a network learns to be right in spite of wrong inputs. Equal generators give
equal failures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.recipes.augment import occlude
from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["MOST_HIDDEN", "gps_errors", "hang", "late", "misread", "muddy"]

Floats32 = NDArray[np.float32]

MOST_HIDDEN = 0.85
"""The largest share of either side of an image that is hidden; the paper hides up to 0.8."""

_SHARE = 1.0 / 3.0
"""The share of rows that suffer from each failure but mud, which is in every second one."""

_MOST_GPS_M = 15.0
_HANGS = 0.4
"""So many cameras of a row that suffers repeat an old picture: about as many as in bursts of 3 s."""


def gps_errors(rows: int, generator: np.random.Generator) -> Floats:
    """Return (rows, 2) metres by which positions are off: 0 to 15 m of deviation, the same in both directions."""
    deviation = generator.uniform(0.0, _MOST_GPS_M, (rows, 1)) * (generator.random((rows, 1)) < _SHARE)
    errors: Floats = deviation * generator.standard_normal((rows, 2))
    return errors


def misread(speed: Floats32, generator: np.random.Generator) -> Floats32:
    """Return what the speedometer says: for some rows a fraction of the truth, around 0.2 to 1, and some noise.

    Speeds are (N,), or (ticks, N): the fraction belongs to the row, the noise to the reading.
    """
    rows = speed.shape[-1]
    factor = generator.uniform(0.2, 1.0, rows) + 0.2 * generator.standard_normal(speed.shape)
    return np.where(generator.random(rows) < _SHARE, factor * speed, speed).astype(np.float32)


def muddy(images: Pixels, old_images: Pixels, generator: np.random.Generator) -> None:
    """Black out a rectangle of every camera of every second row (N, cameras, H, W, 3), each at its own place.

    Its picture of before loses another one, as the paper's occlusion lies elsewhere in every tick. Both are changed in
    place.
    """
    rows = generator.random(len(images)) < 0.5
    for pictures in (images, old_images):
        seen = pictures[rows]
        occlude(seen, generator, chance=1.0, most=MOST_HIDDEN)
        pictures[rows] = seen


def hang(images: Pixels, old_images: Pixels, known: NDArray[np.bool_], generator: np.random.Generator) -> None:
    """Let some cameras of some rows (N, cameras, H, W, 3) show the picture of before, where it is `known`."""
    rows, cameras = images.shape[:2]
    hung = (generator.random((rows, cameras)) < _HANGS) & ((generator.random(rows) < _SHARE) & known)[:, None]
    images[hung] = old_images[hung]


def late(future: Floats32, generator: np.random.Generator) -> Floats32:
    """Return the expert's drive (N, 12, 4) as it looks from where some cars will be when a late control arrives.

    The delay is one or two columns (0.25 or 0.5 s); positions and yaw are those of the car then. The last columns,
    which nobody drove, repeat the last step.
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
