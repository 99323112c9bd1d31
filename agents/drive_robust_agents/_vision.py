"""Plain image processing on one front camera: where the free road ends, and which lamps and signs are lit red or green.

A classical colour pipeline knows the palette of its world: asphalt is grey and learnt per image row (haze brightens far
rows), everything that stands on it has a dark base (tyres, shadow, trousers) or is much bluer or redder than asphalt;
lamps shine in plain red and green; a stop sign is a plate of darker red at the height of the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust import CameraSpec

__all__ = ["CAMERA", "Ground", "Signals", "ground_pixels", "signals"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

CAMERA = CameraSpec("front", x_m=0.3, z_m=2.0, fov_deg=90.0)
_FOCAL_PX = CAMERA.width_px / 2.0 / math.tan(math.radians(CAMERA.fov_deg) / 2.0)
_HORIZON = CAMERA.height_px // 2
_FIRST_ROW = _HORIZON + 5
_HIGHEST_ROW = 12
_SIGN_ROWS = 20
_COLUMN_STEP = 2

_DARK, _BLUE, _RED, _GREY, _BROWN = 0.70, 1.35, 1.7, 0.75, 1.25
_DEAD = 3
_LEARN = 0.12
_LAMP_RED = 210


class Ground:
    """Where each image column first meets something that is not ground, by a model of the asphalt per row."""

    def __init__(self) -> None:
        rows = np.arange(_FIRST_ROW, CAMERA.height_px)
        columns = np.arange(0, CAMERA.width_px, _COLUMN_STEP)
        self._depth_m = _FOCAL_PX * CAMERA.z_m / (rows + 0.5 - CAMERA.height_px / 2.0)
        self._slope = (columns + 0.5 - CAMERA.width_px / 2.0) / _FOCAL_PX
        self._patch = np.abs(self._depth_m[:, None] * self._slope) < np.maximum(1.1, 0.06 * self._depth_m)[:, None]
        self._asphalt: NDArray[np.float32] | None = None

    @property
    def level(self) -> float:
        """Brightness (green, 0..255) of the asphalt nearest to the vehicle."""
        return 98.0 if self._asphalt is None else float(self._asphalt[-20:, 1].mean())

    def bases(self, pixels: Bytes) -> Floats:
        """(k, 2): metres forward and to the right of the vehicle, of the lowest foreign pixel of each column.

        Columns whose view of the ground is blocked by dead (black) pixels first, and columns that are free, are left
        out.
        """
        image = np.ascontiguousarray(pixels[_FIRST_ROW:, ::_COLUMN_STEP])
        if self._asphalt is None:
            self._asphalt = _first_asphalt(image, self._patch)
        planes = [plane.astype(np.float32) for plane in cv2.split(image)]
        red, green, blue = (plane / self._asphalt[:, k, None] for k, plane in enumerate(planes))
        bright = np.maximum(np.maximum(red, green), blue)
        dead = np.maximum(np.maximum(planes[0], planes[1]), planes[2]) <= _DEAD
        dirt = (red > _BROWN * blue) & (green > blue)
        foreign = ((bright < _DARK) & ~dirt) | (blue > _BLUE * red) | (red > _RED * green)
        grey = (bright < 1.25) & (green > 0.8) & (blue > _GREY * red)  # no dirt
        self._learn(planes, self._patch & grey)
        solid = foreign[1:] & foreign[:-1]  # two pixels high at least
        upward = (solid | dead[1:])[::-1]
        lowest = len(upward) - np.argmax(upward, axis=0)  # row of `foreign` again
        hit = upward.any(axis=0)
        columns = np.flatnonzero(hit)
        rows = lowest[columns]
        seen = ~dead[rows, columns]
        columns, rows = columns[seen], rows[seen]
        forward = self._depth_m[rows]
        return np.column_stack((forward + CAMERA.x_m, forward * self._slope[columns]))

    def _learn(self, planes: list[NDArray[np.float32]], like: NDArray[np.bool_]) -> None:
        """Follow the colour of what looks like asphalt in the lane ahead, row by row."""
        assert self._asphalt is not None
        ones = np.ones(like.shape[1], dtype=np.float32)
        chosen = like.astype(np.float32)
        count = chosen @ ones
        total = np.column_stack([(chosen * plane) @ ones for plane in planes])
        known = count >= 3.0
        mean = total[known] / count[known, None]
        self._asphalt[known] += np.float32(_LEARN) * (mean - self._asphalt[known])


def _first_asphalt(image: Bytes, patch: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The median colour of each row's patch; going up it may change only as slowly as haze does."""
    medians = np.array([np.median(image[row][patch[row]], axis=0) for row in range(len(image))], dtype=np.float32)
    medians = np.maximum(medians, 8.0)
    medians[-10:] = np.median(medians[-10:], axis=0)
    for row in range(len(medians) - 11, -1, -1):
        medians[row] = np.clip(medians[row], 0.985 * medians[row + 1], 1.05 * medians[row + 1])
    return medians


@dataclass(frozen=True, slots=True)
class Signals:
    """Pixels above the horizon: of the largest red and green lamp that faces the camera, and of a stop sign's red."""

    red: int
    green: int
    sign: int


def signals(pixels: Bytes) -> Signals:
    """Look for lamps and stop signs; everything on wheels stays below the horizon of a high camera."""
    red, green, blue = cv2.split(np.ascontiguousarray(pixels[_HIGHEST_ROW:_HORIZON, CAMERA.width_px // 4 :]))
    # 2.2 times and 1.8 times as bright, in whole numbers of 16 bits
    red16, green16, blue16 = red.astype(np.int16), green.astype(np.int16), blue.astype(np.int16)
    reddish = (5 * red16 > 11 * np.maximum(green16, blue16)) & (red > 90)
    lit = red >= _LAMP_RED
    return Signals(
        red=_largest_facing(reddish & lit),
        green=_largest_facing((green > 180) & (5 * green16 > 9 * red16) & (2 * green16 > 3 * blue16)),
        sign=int(np.count_nonzero((reddish & ~lit)[-_SIGN_ROWS:])),
    )


def _largest_facing(mask: NDArray[np.bool_]) -> int:
    """The largest blob that is about as wide as high: lamps of crossing roads are seen from the side, as slivers."""
    if not mask.any():
        return 0
    *_, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    blobs = stats[1:]
    width, height = blobs[:, cv2.CC_STAT_WIDTH], blobs[:, cv2.CC_STAT_HEIGHT]
    facing = (width >= 2) & (width >= 0.7 * height)
    return int(blobs[facing, cv2.CC_STAT_AREA].max(initial=0))


def ground_pixels(forward_m: Floats, right_m: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(rows, columns) of the pixels that show these places of flat ground; columns are clipped to the image."""
    depth = forward_m - CAMERA.x_m
    rows = np.floor(CAMERA.height_px / 2.0 + _FOCAL_PX * CAMERA.z_m / depth).astype(np.int64)
    columns = np.floor(CAMERA.width_px / 2.0 + _FOCAL_PX * right_m / depth).astype(np.int64)
    return np.clip(rows, 0, CAMERA.height_px - 1), np.clip(columns, 0, CAMERA.width_px - 1)
