"""Draw runs of pixels of one face, in one colour or with a pattern.

The loops are in float32 without branches, so that the compiler emits vector instructions. No sum is reordered, so the
bits of a picture never change.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Packed
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing.canvas import Triple
from pytest_drive_robust.simulators.embedded.drawing.packed import pack

Pair = tuple[float, float]
Place = tuple[float, float, float, float, float]

SILL_M, FLOOR_M, _BAY_M = 1.0, 3.1, 3.2
WINDOW_HIGH, _WINDOW_WIDE = 0.5, 0.45
"""Height of the first windows above the ground [m], and the share of a bay's width that a window fills."""

_LIT_SHARE_OF_256 = 90
_0, _HALF, _1, _2 = (np.float32(number) for number in (0.0, 0.5, 1.0, 2.0))


@inner
def _behind_air(red: float, green: float, blue: float, haze: Triple, through: Pair, u: int) -> int:
    """Return the lit colour of pixel `u` of a run, packed, behind air. `through`: see `plain`."""
    left = through[0] + np.float32(u) * through[1]
    lost = _1 - left
    return pack(
        red * left + haze[0] * lost + _HALF,
        green * left + haze[1] * lost + _HALF,
        blue * left + haze[2] * lost + _HALF,
    )


@inner
def plain(colours: Packed, own: Triple, haze: Triple, through: Pair) -> None:
    """Draw one lit colour. `through`: the share that the air lets through at the first pixel, its change per pixel."""
    for u in range(len(colours)):
        colours[u] = _behind_air(own[0], own[1], own[2], haze, through, u)


@inner
def _spot(u: int, near: float, place: Place) -> Pair:
    """Return the metres along the face and up from the box's bottom at pixel `u` of a run.

    `place`: along = (place[0] + place[1] * u) / near + place[2], up = place[3] / near + place[4].
    """
    across, across_step, start, climb, rise = place
    depth = _1 / near
    return (across + across_step * np.float32(u)) * depth + start, climb * depth + rise


@inner
def _wave(phase: float, share: float, steep: float) -> float:
    """Return 1 on the first `share` of every period, else 0.

    Edges are 1 / `steep` periods wide (`share` if that is much).
    """
    phase -= np.float32(np.int32(phase))
    phase = phase + _1 if phase < _0 else phase
    rise, again, fall = phase * steep + _HALF, (phase - _1) * steep + _HALF, (phase - share) * steep + _HALF
    rise, again, fall = (rise if rise < _1 else _1, again if again > _0 else _0, fall if fall > _0 else _0)
    fall = fall if fall < _1 else _1
    wave = rise + again - fall
    wave = wave if wave > _0 else _0
    wave = wave if wave < _1 else _1
    return wave if steep >= _2 else share


@inner
def stripes(
    colours: Packed,
    nearness: NDArray[np.float32],
    place: Place,
    pixels_per_m: float,
    own: Triple,
    other: Triple,
    haze: Triple,
    through: Pair,
) -> None:
    """Draw slanted stripes of two colours, half a metre apart; `place` as in `_spot`."""
    slant, per_m, share = np.float32(0.6), _2, _HALF
    steep = _HALF * pixels_per_m
    for u in range(len(colours)):
        along, up = _spot(u, nearness[u], place)
        wave = _wave((along + slant * up) * per_m, share, steep)
        red, green, blue = (
            own[0] + (other[0] - own[0]) * wave,
            own[1] + (other[1] - own[1]) * wave,
            own[2] + (other[2] - own[2]) * wave,
        )
        colours[u] = _behind_air(red, green, blue, haze, through, u)


@inner
def ribs(
    colours: Packed,
    nearness: NDArray[np.float32],
    place: Place,
    pixels_per_m: float,
    own: Triple,
    haze: Triple,
    through: Pair,
) -> None:
    """Draw upright ribs, darker in between."""
    per_m, share, depth = np.float32(1.0 / 0.45), np.float32(0.4), np.float32(0.28)
    steep = np.float32(0.45) * pixels_per_m
    for u in range(len(colours)):
        along, _ = _spot(u, nearness[u], place)
        dark = _1 - depth * _wave(along * per_m, share, steep)
        colours[u] = _behind_air(own[0] * dark, own[1] * dark, own[2] * dark, haze, through, u)


@inner
def facade(
    colours: Packed,
    nearness: NDArray[np.float32],
    place: Place,
    pixels_per_m: float,
    own: Triple,
    window: Triple,
    shining: Triple,
    haze: Triple,
    through: Pair,
    seed: int,
    night: float,
) -> None:
    """Draw windows on every floor; by night some are lit."""
    sill, per_floor, per_bay = np.float32(SILL_M), np.float32(1.0 / FLOOR_M), np.float32(1.0 / _BAY_M)
    high, steep_up = np.float32(WINDOW_HIGH), np.float32(FLOOR_M) * pixels_per_m
    wide, steep_along = np.float32(_WINDOW_WIDE), np.float32(_BAY_M) * pixels_per_m
    for u in range(len(colours)):
        along, up = _spot(u, nearness[u], place)
        bay, floor = (along - sill) * per_bay, (up - sill) * per_floor
        wave = _wave(floor, high, steep_up) * _wave(bay, wide, steep_along)
        red, green, blue = window
        if night > _0:
            word = np.int32(floor) * np.int32(104729) + np.int32(bay) * np.int32(1299709)
            word = np.uint32(word + seed * np.int32(7919)) * np.uint32(2654435761)
            lit = night if ((word >> 15) & 255) < _LIT_SHARE_OF_256 else _0
            red += (shining[0] - red) * lit
            green += (shining[1] - green) * lit
            blue += (shining[2] - blue) * lit
        red, green, blue = (
            own[0] + (red - own[0]) * wave,
            own[1] + (green - own[1]) * wave,
            own[2] + (blue - own[2]) * wave,
        )
        colours[u] = _behind_air(red, green, blue, haze, through, u)
