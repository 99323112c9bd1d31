"""Sample the ground texture along a line of pixels, all in integers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing import texture
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraGround, CameraView

Walk = tuple[int, int, int, int, int, int, int]
"""A line in fixed-point texels of one level: start i, j, step i, j, columns and rows of the level, its first texel."""

_FRACTION_BITS = 20
_WIDE = texture.NEAR_LEVELS
"""The finest level that covers the wide region."""
_RED_BLUE_GREEN = np.uint64(0x00FF00FF00FF)
_ONE, _FOUR, _EIGHT, _TWENTYFOUR = (np.uint64(number) for number in (1, 4, 8, 24))
_OUTSIDE = np.uint64((texture.FAR_TEXEL | (texture.FAR_TEXEL << 24)) & 0x00FF00FF00FF)


@inner
def add_line(
    sums: NDArray[np.uint64],
    ground: CameraGround,
    level: int,
    view: CameraView,
    depth: float,
    ahead: float,
    start_px: float,
) -> None:
    """Add bilinear samples to `sums`: red in bits 0 to 15, blue in 16 to 31, green in 32 to 47.

    The line runs across the picture `depth` metres along the optical axis and `ahead` metres along the ground; `sums`
    begins `start_px` pixels right of the picture's middle. Where `level` has no texels, a coarser level is sampled.
    """
    texels = ground.texels
    near, wide = _walks(ground.levels, level, view, depth, ahead, start_px)
    low, high = _inside(near, 0, len(sums))
    _sample(sums, texels, near, low, high)
    if low > 0 or high < len(sums):
        for first, end in ((0, low), (high, len(sums))):
            wide_low, wide_high = _inside(wide, first, end)
            _sample(sums, texels, wide, wide_low, wide_high)
            for u in range(first, wide_low):
                sums[u] += _OUTSIDE
            for u in range(wide_high, end):
                sums[u] += _OUTSIDE


@inner
def _sample(sums: NDArray[np.uint64], texels: NDArray[np.uint32], walk: Walk, first: int, end: int) -> None:
    """Add the bilinear mean of the four texels around steps `first` to `end` of a walk, weights in sixteenths."""
    i, j, di, dj, columns, _, offset = walk
    i, j = i + first * di, j + first * dj
    for u in range(first, end):
        at = offset + (j >> _FRACTION_BITS) * columns + (i >> _FRACTION_BITS)
        upper, lower = np.uintp(at), np.uintp(at + columns)
        a, b = np.uint64((i >> (_FRACTION_BITS - 4)) & 15), np.uint64((j >> (_FRACTION_BITS - 4)) & 15)
        one, other = _spread(np.uint64(texels[upper])), _spread(np.uint64(texels[upper + _ONE]))
        top = (one << _FOUR) + (other - one) * a
        one, other = _spread(np.uint64(texels[lower])), _spread(np.uint64(texels[lower + _ONE]))
        bottom = (one << _FOUR) + (other - one) * a
        # a negative difference borrows from the neighbouring channel; the sum restores the borrow
        mean = (top << _FOUR) + (bottom - top) * b
        sums[np.uintp(u)] += (mean >> _EIGHT) & _RED_BLUE_GREEN
        i += di
        j += dj


@inner
def _spread(texel: np.uint64) -> np.uint64:
    """Spread 0x00BBGGRR to red in bits 0 to 15, blue in 16 to 31, green in 32 to 47: room for products with 256."""
    lanes: np.uint64 = (texel | (texel << _TWENTYFOUR)) & _RED_BLUE_GREEN
    return lanes


@inner
def _walks(
    levels: Floats, level: int, view: CameraView, depth: float, ahead: float, start_px: float
) -> tuple[Walk, Walk]:
    """Return a line in the texels of `level` and in those of a level of the wide region, one step per pixel."""
    step = depth / view.focal_px
    side = (start_px + 0.5) * step
    x = view.x_m + ahead * view.cos_yaw - side * view.sin_yaw
    y = view.y_m + ahead * view.sin_yaw + side * view.cos_yaw
    if abs(x) > 1e7 or abs(y) > 1e7:
        x, y, step = 1e7, 1e7, 0.0
    dx, dy = -view.sin_yaw * step, view.cos_yaw * step
    near = _line(levels, level, x, y, dx, dy)
    return near, near if level >= _WIDE else _line(levels, _WIDE, x, y, dx, dy)


@inner
def _line(levels: Floats, level: int, x: float, y: float, dx: float, dy: float) -> Walk:
    """Return the walk from (x, y) by (dx, dy) per pixel, in metres, on one level."""
    scale = (1 << _FRACTION_BITS) / levels[level, texture.TEXEL_M]
    half = 1 << (_FRACTION_BITS - 1)
    return (
        int((x - levels[level, texture.CORNER_X]) * scale) - half,
        int((y - levels[level, texture.CORNER_Y]) * scale) - half,
        int(dx * scale),
        int(dy * scale),
        int(levels[level, texture.COLUMNS]),
        int(levels[level, texture.ROWS]),
        int(levels[level, texture.FIRST]),
    )


@inner
def _inside(walk: Walk, first: int, end: int) -> tuple[int, int]:
    """Return (first, end) of the steps in `first`..`end` that lie within the texture."""
    i, j, di, dj, columns, rows, _ = walk
    low, high = _within(i, di, (columns - 1) << _FRACTION_BITS, first, end)
    low, high = _within(j, dj, (rows - 1) << _FRACTION_BITS, low, high)
    return (low, high) if low < high else (end, end)


@inner
def _within(start: int, step: int, limit: int, first: int, end: int) -> tuple[int, int]:
    """Return the u of `first`..`end` with 0 <= start + u * step < limit."""
    if 0 <= start + first * step < limit and 0 <= start + (end - 1) * step < limit:
        return first, end
    if step < 0:
        # mirrored, so that the step is positive below
        start, step = limit - 1 - start, -step
    if step == 0:
        return (first, end) if 0 <= start < limit else (end, end)
    # smallest u with start + u * step >= 0, and with >= limit
    return max(first, -(start // step)), min(end, -((start - limit) // step))
