"""Plain image processing on one front camera: the end of the free road, red and green lamps, stop signs.

A classical colour pipeline knows the palette of its world. Asphalt is grey and learnt per image row (haze brightens far
rows). Objects on the road have a dark base (tyres, shadow, trousers) or are much bluer or redder than asphalt. Lamps
shine in plain red and green. A stop sign is a plate of darker red at the height of the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._classical.daylight import NightDetector, lamp_light
from drive_robust_agents._classical.foreign import (
    COLUMN_STEP,
    DEAD,
    FIRST_ROW,
    foreign_by_day,
    foreign_by_night,
    lowest_foreign,
)
from pytest_drive_robust import CameraSpec
from pytest_drive_robust.arithmetic.scalars import tan
from pytest_drive_robust.jit.arrays import Floats, Ints, Pixels

__all__ = ["CAMERA", "GroundModel", "Signals", "ground_pixels", "signals"]


CAMERA = CameraSpec("front", x_m=0.3, z_m=2.0, fov_deg=90.0)
"""The camera at the front edge of the roof."""
_FOCAL_PX = CAMERA.width_px / 2.0 / tan(math.radians(CAMERA.fov_deg) / 2.0)
_HORIZON = CAMERA.height_px // 2
_HIGHEST_ROW = 12
"""First row in which lamps and signs are looked for."""
_SIGN_ROWS = 20
"""A stop sign is within this many rows above the horizon."""

_MOONLIGHT = 0.12
"""Light on the road by night without headlamps, as a share of the headlamps' light."""
_LIT, _DIM = 0.2, 0.5
"""Light of the headlamps above which the ground is judged, and below which a bright pixel is a lamp."""
_ASPHALT_RANGE = (65.0, 125.0)
"""Colours (0..255) between which asphalt in full light is."""
_UNSEEN = 98.0
"""Assumed brightness of asphalt before any asphalt was seen."""
_ENOUGH = 40
"""Least pixels from which the asphalt's colour is learnt by night."""
_LEARN = 0.12
"""Share of a new picture in the asphalt's colour by night."""
_LAMP_RED = 210
"""Least red (0..255) of a lit lamp's pixel."""


class GroundModel:
    """Finds the first pixel of each image column that is not ground, by a model of the asphalt's colour.

    By day the model is the colour of each row. By night the model is the light of the vehicle's own headlamps, which
    fades to the sides, and only pixels in this light are judged: street lamps make the road brighter, never darker.
    """

    def __init__(self) -> None:
        rows = np.arange(FIRST_ROW, CAMERA.height_px, dtype=np.float64)
        columns = np.arange(0, CAMERA.width_px, COLUMN_STEP, dtype=np.float64)
        self._depth_m = _FOCAL_PX * CAMERA.z_m / (rows + 0.5 - CAMERA.height_px / 2.0)
        self._slope = (columns + 0.5 - CAMERA.width_px / 2.0) / _FOCAL_PX
        right_m = self._depth_m[:, None] * self._slope
        self._patch = np.abs(right_m) < np.maximum(1.1, 0.06 * self._depth_m)[:, None]
        lit = lamp_light(self._depth_m[:, None] + CAMERA.x_m, right_m)
        self._light = lit + _MOONLIGHT
        self._lit, self._dim = lit > _LIT, lit < _DIM
        self._asphalt: Floats | None = None
        self._paint = np.full(3, _UNSEEN)
        self._dusk = NightDetector()
        self._night = False

    def brightness(self, forward_m: Floats) -> Floats:
        """Return the brightness (green, 0..255) of the asphalt `forward_m` metres ahead of the vehicle's middle."""
        if self._night:
            lit: Floats = float(self._paint[1]) * (lamp_light(forward_m, np.zeros_like(forward_m)) + _MOONLIGHT)
            return lit
        if self._asphalt is None:
            return np.full(len(forward_m), _UNSEEN)
        return np.full(len(forward_m), math.fsum(self._asphalt[-20:, 1].tolist()) / 20.0)

    def bases(self, pixels: Pixels) -> Floats:
        """Return the lowest foreign pixel of each column as (k, 2) metres forward and to the right of the vehicle.

        Free columns are left out, and so are columns where dead (black) pixels come first.
        """
        self._night = self._dusk.see(pixels)
        if self._night:
            self._follow_paint(np.ascontiguousarray(pixels[FIRST_ROW:, ::COLUMN_STEP]))
            foreign = foreign_by_night(pixels, self._light, self._lit, self._dim, self._paint)
        else:
            if self._asphalt is None:
                self._asphalt = _first_asphalt(np.ascontiguousarray(pixels[FIRST_ROW:, ::COLUMN_STEP]), self._patch)
            foreign = foreign_by_day(pixels, self._patch, self._asphalt)
        found: Floats = lowest_foreign(foreign, self._depth_m, self._slope, CAMERA.x_m)
        return found

    def _follow_paint(self, image: Pixels) -> None:
        """Update the asphalt's colour in full light from the darker part of the lane; lamps and markings only add."""
        places = (self._patch & self._lit & (image.max(axis=2) > DEAD))[::3, ::2]
        shades = image[::3, ::2][places] / self._light[::3, ::2][places][:, None]
        if len(shades) < _ENOUGH:
            return
        darker = np.partition(shades[:, 1], len(shades) // 4)[len(shades) // 4]
        like = shades[np.abs(shades[:, 1] - darker) < 0.15 * darker]
        mean = np.cumsum(like, axis=0)[-1] / len(like)  # cumsum adds in a fixed order, which keeps the bits
        self._paint = np.clip(self._paint + _LEARN * (mean - self._paint), *_ASPHALT_RANGE)


def _first_asphalt(image: Pixels, patch: NDArray[np.bool_]) -> Floats:
    """Return the median colour of each row's patch; from row to row upwards it changes only as slowly as haze does."""
    medians: Floats = np.array([np.median(image[row][patch[row]], axis=0) for row in range(len(image))])
    medians = np.maximum(medians, 8.0)
    medians[-10:] = np.median(medians[-10:], axis=0)
    for row in range(len(medians) - 11, -1, -1):
        tint = (medians[row, 2] / medians[row, 0]) / (medians[row + 1, 2] / medians[row + 1, 0])
        seen = medians[row] if 0.9 < tint < 1.1 else medians[row + 1]
        medians[row] = np.clip(seen, 0.985 * medians[row + 1], 1.05 * medians[row + 1])
    return medians


@dataclass(frozen=True, slots=True)
class Signals:
    """Pixel counts above the horizon: largest red and green lamp that face the camera, and a stop sign's red."""

    red: int
    green: int
    sign: int


def signals(pixels: Pixels) -> Signals:
    """Count the pixels of lamps and stop signs; vehicles stay below the horizon of a high camera."""
    import cv2  # late: the import takes 0.1 s, and a run whose episodes are stored does not need it

    red, green, blue = cv2.split(np.ascontiguousarray(pixels[_HIGHEST_ROW:_HORIZON, CAMERA.width_px // 4 :]))
    red16, green16, blue16 = (plane.astype(np.int16) for plane in (red, green, blue))  # 2.2 times: 5 to 11
    reddish = (5 * red16 > 11 * np.maximum(green16, blue16)) & (red > 90)
    lit = red >= _LAMP_RED
    return Signals(
        red=_largest_facing(reddish & lit),
        green=_largest_facing((green > 180) & (5 * green16 > 9 * red16) & (2 * green16 > 3 * blue16)),
        sign=int(np.count_nonzero((reddish & ~lit)[-_SIGN_ROWS:])),
    )


def _largest_facing(mask: NDArray[np.bool_]) -> int:
    """Return the pixels of the largest blob that is about as wide as high.

    Lamps of crossing roads are seen from the side, as slivers.
    """
    if not mask.any():
        return 0
    import cv2

    *_, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    blobs = stats[1:]
    width, height = blobs[:, cv2.CC_STAT_WIDTH], blobs[:, cv2.CC_STAT_HEIGHT]
    facing = (width >= 2) & (width >= 0.7 * height)
    return int(blobs[facing, cv2.CC_STAT_AREA].max(initial=0))


def ground_pixels(forward_m: Floats, right_m: Floats) -> tuple[Ints, Ints]:
    """Return (rows, columns) of the pixels that show these places of flat ground; columns are clipped to the image."""
    depth = forward_m - CAMERA.x_m
    rows = np.floor(CAMERA.height_px / 2.0 + _FOCAL_PX * CAMERA.z_m / depth).astype(np.int64)
    columns = np.floor(CAMERA.width_px / 2.0 + _FOCAL_PX * right_m / depth).astype(np.int64)
    return np.clip(rows, 0, CAMERA.height_px - 1), np.clip(columns, 0, CAMERA.width_px - 1)
