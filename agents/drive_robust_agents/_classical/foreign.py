"""Find the pixels that are not ground; compiled."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.jit.arrays import Bytes2, Bytes3, Floats, Floats1, Floats2, Mask2, Pixels
from pytest_drive_robust.jit.kernels import entry

__all__ = ["COLUMN_STEP", "DEAD", "FIRST_ROW", "foreign_by_day", "foreign_by_night", "lowest_foreign"]


FIRST_ROW, COLUMN_STEP = 77, 2
"""First examined row of the picture, just below the horizon, and the step between examined columns."""
DEAD = 3
"""Greatest brightness of a dead pixel."""
_FOREIGN, _DEAD = np.uint8(1), np.uint8(2)
"""The bits of a flag: no ground, and a dead pixel."""
_DARK, _BLUE, _RED, _GREY, _BROWN = 0.70, 1.35, 1.7, 0.75, 1.25
"""What is no ground, as shares of the asphalt's colour: darker than `_DARK`, bluer than `_BLUE` times its red, redder
than `_RED` times its green. Dirt is `_BROWN` times as red as blue; asphalt at least `_GREY` times as blue as red."""
_DARK_BY_NIGHT, _SHINING = 0.55, 200
"""`_DARK` by night, and the brightness (0..255) from which a pixel beside the headlamps' light is a lamp."""
_LEARN, _LEAST_KNOWN = 0.12, 3
"""Share of a new row's colour in the asphalt's, and the pixels of asphalt without which nothing is learnt."""


@entry
def foreign_by_day(pixels: Bytes3, patch: Mask2, asphalt: Floats2) -> Pixels:
    """Return (rows, columns) flags against the asphalt of each row: bit 1 for no ground, bit 2 for a dead pixel.

    `pixels` is the whole picture. `asphalt` (rows, 3) is then moved towards the colour of the asphalt-like pixels in
    `patch`, the lane ahead.
    """
    rows, columns = patch.shape
    found = np.zeros((rows, columns), np.uint8)
    for i in range(rows):
        of_red, of_green, of_blue = 1.0 / asphalt[i, 0], 1.0 / asphalt[i, 1], 1.0 / asphalt[i, 2]
        count, red_sum, green_sum, blue_sum = 0, 0, 0, 0
        for j in range(columns):
            r = np.int64(pixels[FIRST_ROW + i, COLUMN_STEP * j, 0])
            g = np.int64(pixels[FIRST_ROW + i, COLUMN_STEP * j, 1])
            b = np.int64(pixels[FIRST_ROW + i, COLUMN_STEP * j, 2])
            red, green, blue = r * of_red, g * of_green, b * of_blue
            bright = max(red, green, blue)
            dirt = (red > _BROWN * blue) & (green > blue)
            foreign = ((bright < _DARK) & (not dirt)) | (blue > _BLUE * red) | (red > _RED * green)
            dead = max(r, g, b) <= DEAD
            found[i, j] = (_FOREIGN if foreign else np.uint8(0)) | (_DEAD if dead else np.uint8(0))
            if patch[i, j] and not foreign and bright < 1.25 and green > 0.8 and blue > _GREY * red:
                count, red_sum, green_sum, blue_sum = count + 1, red_sum + r, green_sum + g, blue_sum + b
        if count >= _LEAST_KNOWN:
            asphalt[i, 0] += _LEARN * (red_sum / count - asphalt[i, 0])
            asphalt[i, 1] += _LEARN * (green_sum / count - asphalt[i, 1])
            asphalt[i, 2] += _LEARN * (blue_sum / count - asphalt[i, 2])
    return found


@entry
def foreign_by_night(pixels: Bytes3, light: Floats2, lit: Mask2, dim: Mask2, paint: Floats1) -> Pixels:
    """Return the flags of `foreign_by_day`, against asphalt of colour `paint` in the headlamps; finds lamps beside it.

    `light`, `lit` and `dim` (rows, columns) give the light that falls on each place.
    """
    rows, columns = light.shape
    found = np.zeros((rows, columns), np.uint8)
    for i in range(rows):
        for j in range(columns):
            r = np.int64(pixels[FIRST_ROW + i, COLUMN_STEP * j, 0])
            g = np.int64(pixels[FIRST_ROW + i, COLUMN_STEP * j, 1])
            b = np.int64(pixels[FIRST_ROW + i, COLUMN_STEP * j, 2])
            share = 1.0 / light[i, j]
            red, green, blue = r * share / paint[0], g * share / paint[1], b * share / paint[2]
            dirt = (red > _BROWN * blue) & (green > blue)
            foreign = (max(red, green, blue) < _DARK_BY_NIGHT) & (not dirt)
            foreign |= ((blue > _BLUE * red) & (not dim[i, j])) | (red > _RED * green)
            lamp = min(r, g, b) > _SHINING
            seen = (foreign & lit[i, j]) | (lamp & dim[i, j])
            found[i, j] = (_FOREIGN if seen else np.uint8(0)) | (_DEAD if max(r, g, b) <= DEAD else np.uint8(0))
    return found


@entry
def lowest_foreign(found: Bytes2, depth_m: Floats1, slope: Floats1, camera_m: float) -> Floats:
    """Return (k, 2) metres (forward, right) of the lowest foreign pixels of each column, at least two pixels high.

    `depth_m` (rows,) is the distance from the camera at which a row shows the ground, `slope` (columns,) the metres to
    the right per metre of that distance. The camera is mounted `camera_m` ahead of the vehicle's middle.
    """
    rows, columns = found.shape
    places, count = np.empty((columns, 2)), 0
    for j in range(columns):
        for i in range(rows - 1, 0, -1):
            if found[i, j] & _DEAD:
                break
            if found[i, j] & found[i - 1, j] & _FOREIGN:
                places[count, 0], places[count, 1] = depth_m[i] + camera_m, depth_m[i] * slope[j]
                count += 1
                break
    return places[:count]
