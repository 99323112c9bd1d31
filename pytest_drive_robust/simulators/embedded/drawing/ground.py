"""Draws sky and ground of one camera: for each row of pixels a straight walk over the ground texture.

No camera of ours rolls, so that a row of pixels meets the ground at one depth and along a straight line. Rows far away
are stretched over many texels in depth: they are averaged from several lines, which keeps stop lines and dashes calm.
All sampling is in integers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.simulators.embedded.drawing.air import Air
    from pytest_drive_robust.simulators.embedded.drawing.view import Headlamps, View

    Walk = tuple[int, int, int, int, int, int, int]

__all__ = ["draw_ground"]

_MOST_LINES = 4
_LEVEL_ONE_M = 12.0
_FRACTION_BITS = 20
_FLATTEST = -1e-4
_WIDE = 2
_RED_BLUE, _GREEN, _GREEN_SHIFT = np.uint64(0x00FF00FF), np.uint64(0x0000FF00), np.uint64(24)
_LANES, _LANE = np.uint64(0x00FF00FF00FF), np.uint64(0xFFFF)
_ONE, _EIGHT, _SIXTEEN, _THIRTYTWO = np.uint64(1), np.uint64(8), np.uint64(16), np.uint64(32)


@njit(cache=True, error_model="numpy")
def draw_ground(
    image: NDArray[np.uint8],
    texels: NDArray[np.uint32],
    levels: NDArray[np.float64],
    far: int,
    view: View,
    air: Air,
    lamps: Headlamps,
) -> None:
    """Fills every pixel of `image` (height, width, 3). `far` is the packed colour outside of the texture."""
    height, width = image.shape[0], image.shape[1]
    sums = np.empty(width, np.uint64)
    sin_pitch, cos_pitch = view.sin_pitch, view.cos_pitch
    for row in range(height):
        rise = sin_pitch + (height / 2.0 - row - 0.5) / view.focal_px * cos_pitch
        if rise > _FLATTEST:
            _sky_row(image, row, rise, air)
            continue
        depth = -view.z_m / rise
        across_m = depth / view.focal_px
        along_m = across_m * depth / view.z_m
        lines = min(max(int(along_m / across_m / 3.0) + 1, 1), _MOST_LINES)
        level = _level(levels, max(across_m, along_m / lines / 2.5))
        sums[:] = 0
        for line in range(lines):
            up = (height / 2.0 - row - (line + 0.5) / lines) / view.focal_px
            line_rise = min(sin_pitch + up * cos_pitch, _FLATTEST)
            line_depth = -view.z_m / line_rise
            ahead = line_depth * (cos_pitch - up * sin_pitch)
            _walk(sums, texels, levels, level, far, view, line_depth, ahead)
        _ground_row(
            image,
            row,
            sums,
            lines,
            depth,
            depth * (cos_pitch - (height / 2.0 - row - 0.5) / view.focal_px * sin_pitch),
            view,
            air,
            lamps,
        )


@njit(cache=True, error_model="numpy")
def _level(levels: NDArray[np.float64], footprint_m: float) -> int:
    """The level whose texels are nearest to the footprint of a pixel."""
    level = math.floor(math.log2(max(footprint_m / levels[0, 5], 1.0)) + 0.35)
    return min(level, len(levels) - 1)


@njit(cache=True, error_model="numpy")
def _sky_row(image: NDArray[np.uint8], row: int, rise: float, air: Air) -> None:
    share = min(max(rise, 0.0) / 0.45, 1.0) ** 0.7
    for channel in range(3):
        colour = air.haze[channel] + (air.sky_top[channel] - air.haze[channel]) * share
        image[row, :, channel] = np.uint8(colour + 0.5)


@njit(cache=True, error_model="numpy")
def _walk(
    sums: NDArray[np.uint64],
    texels: NDArray[np.uint32],
    levels: NDArray[np.float64],
    level: int,
    far: int,
    view: View,
    depth: float,
    ahead: float,
) -> None:
    """Adds one line of bilinear samples to `sums`: red, blue and green in 16 bits each (see `_spread`)."""
    width = len(sums)
    sin_yaw, cos_yaw = view.sin_yaw, view.cos_yaw
    step = depth / view.focal_px
    start = (0.5 - width / 2.0) * step
    x, y = view.x_m + ahead * cos_yaw - start * sin_yaw, view.y_m + ahead * sin_yaw + start * cos_yaw
    if abs(x) > 1e7 or abs(y) > 1e7:
        x, y, step = 1e7, 1e7, 0.0
    walk = _line(levels, level, x, y, -sin_yaw * step, cos_yaw * step)
    if _inside(walk, 0) and _inside(walk, width - 1):
        # both ends of a straight line inside: so is the rest
        for u in range(width):
            sums[u] += _sample(texels, walk, u)
        return
    wide = _line(levels, max(level, _WIDE), x, y, -sin_yaw * step, cos_yaw * step)
    outside = _spread(np.uint64(far))
    for u in range(width):
        if _inside(walk, u):
            sums[u] += _sample(texels, walk, u)
        elif _inside(wide, u):
            sums[u] += _sample(texels, wide, u)
        else:
            sums[u] += outside


@njit(cache=True, error_model="numpy")
def _inside(walk: Walk, u: int) -> bool:
    i, j, di, dj, columns, rows, _ = walk
    return 0 <= i + u * di < (columns - 1) << _FRACTION_BITS and 0 <= j + u * dj < (rows - 1) << _FRACTION_BITS


@njit(cache=True, error_model="numpy")
def _spread(texel: np.uint64) -> np.uint64:
    """0x00BBGGRR to red in bits 0 to 15, blue in 16 to 31, green in 32 to 47: room for sums and products."""
    lanes: np.uint64 = (texel & _RED_BLUE) | ((texel & _GREEN) << _GREEN_SHIFT)
    return lanes


@njit(cache=True, error_model="numpy")
def _sample(texels: NDArray[np.uint32], walk: Walk, u: int) -> np.uint64:
    """The bilinear mean of the four texels around step `u` of a walk, weights in sixteenths."""
    i, j, di, dj, columns, _, first = walk
    i += u * di
    j += u * dj
    at = first + (j >> _FRACTION_BITS) * columns + (i >> _FRACTION_BITS)
    upper, lower = np.uintp(at), np.uintp(at + columns)
    a, b = np.uint64((i >> (_FRACTION_BITS - 4)) & 15), np.uint64((j >> (_FRACTION_BITS - 4)) & 15)
    top = _spread(np.uint64(texels[upper])) * (_SIXTEEN - a) + _spread(np.uint64(texels[upper + _ONE])) * a
    bottom = _spread(np.uint64(texels[lower])) * (_SIXTEEN - a) + _spread(np.uint64(texels[lower + _ONE])) * a
    mean: np.uint64 = ((top * (_SIXTEEN - b) + bottom * b) >> _EIGHT) & _LANES
    return mean


@njit(cache=True, error_model="numpy")
def _line(levels: NDArray[np.float64], level: int, x: float, y: float, dx: float, dy: float) -> Walk:
    """A walk in fixed-point texels of one level: start, step, columns, rows, first texel."""
    scale = (1 << _FRACTION_BITS) / levels[level, 5]
    half = 1 << (_FRACTION_BITS - 1)
    return (
        int((x - levels[level, 3]) * scale) - half,
        int((y - levels[level, 4]) * scale) - half,
        int(dx * scale),
        int(dy * scale),
        int(levels[level, 1]),
        int(levels[level, 2]),
        int(levels[level, 0]),
    )


@njit(cache=True, error_model="numpy")
def _ground_row(
    image: NDArray[np.uint8],
    row: int,
    sums: NDArray[np.uint64],
    lines: int,
    depth: float,
    ahead: float,
    view: View,
    air: Air,
    lamps: Headlamps,
) -> None:
    """Light and haze on the summed samples of one row."""
    clear = math.exp(-air.haze_per_m * depth)
    lit = air.ambient + air.diffuse * max(air.sun[2], 0.0)
    red, green, blue = (
        clear * lit * air.light[0] / lines,
        clear * lit * air.light[1] / lines,
        clear * lit * air.light[2] / lines,
    )
    haze_red, haze_green, haze_blue = (
        air.haze[0] * (1.0 - clear) + 0.5,
        air.haze[1] * (1.0 - clear) + 0.5,
        air.haze[2] * (1.0 - clear) + 0.5,
    )
    width = len(sums)
    turn = view.yaw_rad - lamps.yaw_rad
    sin_turn, cos_turn = math.sin(turn), math.cos(turn)
    dx, dy = view.x_m - lamps.x_m, view.y_m - lamps.y_m
    sin_ego, cos_ego = math.sin(lamps.yaw_rad), math.cos(lamps.yaw_rad)
    from_x, from_y = cos_ego * dx + sin_ego * dy, cos_ego * dy - sin_ego * dx
    for u in range(width):
        r = np.float64(np.int64(sums[u] & _LANE))
        g = np.float64(np.int64(sums[u] >> _THIRTYTWO))
        b = np.float64(np.int64((sums[u] >> _SIXTEEN) & _LANE))
        extra = 0.0
        if lamps.strength > 0.0:
            side = (u + 0.5 - width / 2.0) * depth / view.focal_px
            forward = from_x + ahead * cos_turn - side * sin_turn
            right = from_y + ahead * sin_turn + side * cos_turn
            extra = _headlamp(forward, right) * lamps.strength * clear / lines
        image[row, u, 0] = np.uint8(min(r * (red + extra) + haze_red, 255.0))
        image[row, u, 1] = np.uint8(min(g * (green + extra) + haze_green, 255.0))
        image[row, u, 2] = np.uint8(min(b * (blue + extra * 0.9) + haze_blue, 255.0))


@njit(cache=True, error_model="numpy")
def _headlamp(forward_m: float, right_m: float) -> float:
    """How much light the ego's headlamps throw on a place, 0..1: a cone that widens and fades."""
    if forward_m < 2.0:
        return 0.0
    beam = 1.0 - abs(right_m) / (1.6 + 0.35 * forward_m)
    if beam <= 0.0:
        return 0.0
    return min(beam * 1.6, 1.0) * min((forward_m - 2.0) / 4.0, 1.0) / (1.0 + (forward_m / 22.0) ** 2)
