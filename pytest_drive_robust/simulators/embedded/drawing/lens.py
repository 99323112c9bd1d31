"""Draw rain, drops on the lens and the glare of a low sun over a finished picture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView

_STREAKS_PER_PIXEL = 0.004
_LENGTH_SHARE = 0.07
_OPACITY = 0.3
_MOST_DROPS = 18
_DROP_TICKS = 50
_SMALLEST, _LARGEST = 0.012, 0.034
_GLOW, _DISC = 0.42, 0.024
_HIDDEN = 0.3
_VEIL = 0.33
_SUN_RED, _SUN_GREEN, _SUN_BLUE = 255.0, 206.0, 132.0


@inner
def draw_lens(image: NDArray[np.uint8], faces: NDArray[Any], tick: int, view: CameraView, air: Air) -> None:
    """Draw over `image` (height, width, 3); a function of `tick`, the picture and the camera only.

    `faces` (height, width) is 0 where no box is seen: a box hides the sun.
    """
    if air.glare > 0.0:
        _sun(image, faces, view, air)
    if air.rain > 0.0:
        _rain(image, tick, air)
    if air.drops > 0.0:
        _drops(image, tick, air.drops)


@inner
def _hash(first: int, second: int) -> int:
    word = (first * 668265263 + second * 374761393) & 0x7FFFFFFFFFFF
    word = ((word ^ (word >> 13)) * 1274126177) & 0x7FFFFFFFFFFF
    return word ^ (word >> 16)


@inner
def _rain(image: NDArray[np.uint8], tick: int, air: Air) -> None:
    """Draw thin streaks a little brighter than the horizon."""
    height, width = image.shape[0], image.shape[1]
    red, green, blue = (_streak(air.haze[0]), _streak(air.haze[1]), _streak(air.haze[2]))
    for streak in range(int(air.rain * _STREAKS_PER_PIXEL * height * width)):
        word = _hash(tick, streak)
        column, row = word % width, (word // width) % height
        length = int(height * _LENGTH_SHARE * (0.4 + 0.6 * ((word >> 20) & 15) / 15.0)) + 1
        for step in range(length):
            at_row, at_column = row + step, column - step // 5
            if at_row >= height or at_column < 0:
                break
            _blend(image, at_row, at_column, red, green, blue, _OPACITY)


@inner
def _streak(haze: float) -> float:
    return min(0.8 * haze + 85.0, 235.0)


@inner
def _blend(
    image: NDArray[np.uint8], row: int, column: int, red: float, green: float, blue: float, share: float
) -> None:
    image[row, column, 0] = np.uint8(image[row, column, 0] + (red - image[row, column, 0]) * share)
    image[row, column, 1] = np.uint8(image[row, column, 1] + (green - image[row, column, 1]) * share)
    image[row, column, 2] = np.uint8(image[row, column, 2] + (blue - image[row, column, 2]) * share)


@inner
def _drops(image: NDArray[np.uint8], tick: int, strength: float) -> None:
    """Draw round drops, each for 2.5 s at one place, that show their surroundings upside down."""
    height, width = image.shape[0], image.shape[1]
    for drop in range(int(1.0 + strength * (_MOST_DROPS - 1))):
        word = _hash((tick + drop * 17) // _DROP_TICKS, drop + 1000)
        u, v = word % width, (word // width) % height
        radius = width * (_SMALLEST + (_LARGEST - _SMALLEST) * (((word >> 20) & 15) / 15.0) ** 2)
        for row in range(max(int(v - radius), 0), min(int(v + radius) + 1, height)):
            for column in range(max(int(u - radius), 0), min(int(u + radius) + 1, width)):
                x, y = (column - u) / radius, (row - v) / radius
                away = x * x + y * y
                if away > 1.0:
                    continue
                bend = 2.0 + 1.5 * away
                from_row = min(max(int(v - y * bend * radius), 0), height - 1)
                from_column = min(max(int(u - x * bend * radius), 0), width - 1)
                lit = 1.0 + 0.25 * (0.5 - away) + 0.15 * y
                share = min((1.0 - away) * 3.0, 0.85)
                _blend(
                    image,
                    row,
                    column,
                    min(image[from_row, from_column, 0] * lit, 255.0),
                    min(image[from_row, from_column, 1] * lit, 255.0),
                    min(image[from_row, from_column, 2] * lit, 255.0),
                    share,
                )


@inner
def _sun(image: NDArray[np.uint8], faces: NDArray[Any], view: CameraView, air: Air) -> None:
    """Draw the disc of the sun and a glow around the disc, weaker when a box hides the sun."""
    height, width = image.shape[0], image.shape[1]
    x, y, z = air.disc
    ahead, right = x * view.cos_yaw + y * view.sin_yaw, y * view.cos_yaw - x * view.sin_yaw
    up, forward = z * view.cos_pitch - ahead * view.sin_pitch, ahead * view.cos_pitch + z * view.sin_pitch
    if forward < 0.2:
        return
    u, v = 0.5 * width + view.focal_px * right / forward, 0.5 * height - view.focal_px * up / forward
    strength = air.glare
    inside = 0.0 <= u < width and 0.0 <= v < height
    if not inside or faces[int(v), int(u)] != 0:
        strength *= _HIDDEN
    reach = _GLOW * view.focal_px
    _glow(image, faces, u, v, reach, 0.9 * strength)
    if strength < air.glare:
        return
    radius = _DISC * view.focal_px
    for row in range(max(int(v - radius), 0), min(int(v + radius) + 1, height)):
        for column in range(max(int(u - radius), 0), min(int(u + radius) + 1, width)):
            away = (row + 0.5 - v) * (row + 0.5 - v) + (column + 0.5 - u) * (column + 0.5 - u)
            if away < radius * radius and faces[row, column] == 0:
                _blend(image, row, column, 255.0, 250.0, 226.0, 0.95)


@inner
def _glow(image: NDArray[np.uint8], faces: NDArray[Any], u: float, v: float, reach: float, strength: float) -> None:
    """Blend the sun's colour in around (u, v), fading out at `reach` pixels.

    Boxes are blended less, so that a traffic light before the sun keeps a recognizable colour.
    """
    height, width = image.shape[0], image.shape[1]
    red, green, blue = np.float32(_SUN_RED), np.float32(_SUN_GREEN), np.float32(_SUN_BLUE)
    one, fade, most, veil = (
        np.float32(1.0),
        np.float32(1.0 / (reach * reach)),
        np.float32(strength),
        np.float32(strength * _VEIL),
    )
    for row in range(max(math.ceil(v - reach - 0.5), 0), min(math.floor(v + reach - 0.5), height - 1) + 1):
        down = (row + 0.5 - v) * (row + 0.5 - v)
        chord = math.sqrt(max(reach * reach - down, 0.0))
        first = max(math.ceil(u - chord - 0.5), 0)
        nearest, start = np.float32(one - np.float32(down) * fade), np.float32(first + 0.5 - u)
        line, hidden = image[row], faces[row]
        for column in range(first, min(math.floor(u + chord - 0.5), width - 1) + 1):
            aside = start + np.float32(column - first)
            near = nearest - aside * aside * fade
            share = (most if hidden[column] == 0 else veil) * near * near * near
            line[column, 0] = np.uint8(np.int32(line[column, 0] + (red - line[column, 0]) * share))
            line[column, 1] = np.uint8(np.int32(line[column, 1] + (green - line[column, 1]) * share))
            line[column, 2] = np.uint8(np.int32(line[column, 2] + (blue - line[column, 2]) * share))
