"""Track the markings of the own lane in a band of ground ahead: offset, heading and curvature of its middle."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._classical.vision import ground_pixels
from pytest_drive_robust.jit.arrays import Bytes3, Floats, Floats1, Ints, Ints2, Pixels
from pytest_drive_robust.jit.kernels import entry, inner

__all__ = ["LaneTracker"]

_RIGHT_STEP_M, _FARTHEST_M = 0.12, 5.4
"""Samples across the lane: metres between two, and metres to the outermost on both sides."""
_RIGHT_M = np.arange(-_FARTHEST_M, _FARTHEST_M + 0.01, _RIGHT_STEP_M)
_FLANK = 3
"""Samples (0.36 m) to both sides that must be darker than a marking, because a zebra bar is wider."""
_REACH = 5
"""Samples (0.6 m) to both sides of the expected place within which a marking is searched."""
_CONTRAST = 0.22
"""How much brighter than its flanks a marking is, as a share of the asphalt's brightness."""
_PRIOR = (6.0, 400.0, 30000.0)
"""Weights of the last offset, slope and bend, against 1 for each marking seen."""
_NARROWEST_M, _WIDEST_M = 3.1, 4.0
"""Widths of the lane between which it is tracked."""


class LaneTracker:
    """Tracks the middle of the lane, `y = c0 + c1 x + c2 x^2 / 2`, metres forward (x) and to the right (y)."""

    FORWARD_M: Floats = np.arange(5.0, 19.0, 0.6)
    """Metres ahead of the vehicle's middle at which markings are searched."""

    def __init__(self) -> None:
        grid = np.meshgrid(self.FORWARD_M, _RIGHT_M, indexing="ij")
        self._rows, self._columns = ground_pixels(*grid)
        self.forget(0.0, 0.0)

    def forget(self, offset_m: float, slope: float) -> None:
        """Start again from a guess of the lane's offset and slope."""
        self._state: tuple[float, float, float] = (offset_m, slope, 0.0)
        self._width_m = 3.5
        self.quality = 0.0

    def middle(self, forward_m: Floats) -> Floats:
        """Return the lane's middle, metres to the right, at these metres ahead."""
        forward = np.clip(forward_m, 0.0, 22.0)
        offset, slope, bend = self._state
        middle: Floats = offset + slope * forward + 0.5 * bend * (forward * forward)
        return middle

    def move(self, travelled_m: float, turned_rad: float) -> None:
        """Move the lane estimate by the vehicle's own motion."""
        offset, slope, bend = self._state
        self._state = (offset + slope * travelled_m, slope + bend * travelled_m - turned_rad, bend)

    def see(self, pixels: Pixels, asphalt: Floats) -> None:
        """Correct the lane by the markings of one image.

        `asphalt` is the brightness of the road (green, 0..255) at `LaneTracker.FORWARD_M`.
        """
        self._state, self._width_m, seen = _fit(
            pixels, asphalt, self.FORWARD_M, self._rows, self._columns, self._state, self._width_m
        )
        self.quality += 0.1 * (seen - self.quality)


@inner
def _peak(pixels: Pixels, rows: Ints, columns: Ints, i: int, expected_m: float, least: float) -> tuple[float, bool]:
    """Return (metres to the right, whether found) of the strongest marking near its expected place in row `i`."""
    most = columns.shape[1] - 2 * _FLANK - 2 * _REACH - 1
    wanted = math.floor((expected_m + _FARTHEST_M) / _RIGHT_STEP_M - _FLANK + 0.5) - _REACH
    first = min(max(wanted, 0), most)
    best, at, height = -1e9, 0, 0.0
    for k in range(2 * _REACH + 1):
        j = first + k
        left = np.int64(pixels[rows[i, j], columns[i, j], 1])
        inner = np.int64(pixels[rows[i, j + _FLANK], columns[i, j + _FLANK], 1])
        right = np.int64(pixels[rows[i, j + 2 * _FLANK], columns[i, j + 2 * _FLANK], 1])
        ridge = float(inner - max(left, right))
        score = ridge - 0.3 * least * abs(k - _REACH) / _REACH
        if score > best:
            best, at, height = score, j, ridge
    return (at + _FLANK) * _RIGHT_STEP_M - _FARTHEST_M, height > least and first == wanted


@entry
def _fit(
    pixels: Bytes3, asphalt: Floats1, forward_m: Floats1, rows: Ints2, columns: Ints2,
    state: tuple[float, float, float], width_m: float,
) -> tuple[tuple[float, float, float], float, float]:  # fmt: skip
    """Return (state, width of the lane, share of the rows with a marking) after one picture: weighted least squares.

    The previous state counts as a measurement with the weights `_PRIOR`.
    """
    count = len(forward_m)
    places, strong = np.empty((2, count)), np.zeros((2, count), np.bool_)
    widths, both, either = np.empty(count), 0, 0
    for i in range(count):
        x = forward_m[i]
        middle = state[0] + state[1] * x + state[2] * (0.5 * x * x)
        for side in range(2):
            expected = middle + (side - 0.5) * width_m
            places[side, i], strong[side, i] = _peak(pixels, rows, columns, i, expected, _CONTRAST * asphalt[i])
        either += strong[0, i] or strong[1, i]
        if strong[0, i] and strong[1, i]:
            between = both  # keep both sorted by width
            while between > 0 and widths[between - 1] > places[1, i] - places[0, i]:
                widths[between] = widths[between - 1]
                between -= 1
            widths[between] = places[1, i] - places[0, i]
            both += 1
    if both >= 3:
        median = 0.5 * (widths[(both - 1) // 2] + widths[both // 2])
        width_m = min(max(0.9 * width_m + 0.1 * median, _NARROWEST_M), _WIDEST_M)
    a, b, c, d, e, f = _PRIOR[0], 0.0, 0.0, _PRIOR[1], 0.0, _PRIOR[2]  # rows of a symmetric matrix
    p, q, r = _PRIOR[0] * state[0], _PRIOR[1] * state[1], _PRIOR[2] * state[2]
    for side in range(2):
        for i in range(count):
            if strong[side, i]:
                x = forward_m[i]
                h, y = 0.5 * x * x, places[side, i] - (side - 0.5) * width_m
                a, b, c, d, e, f = a + 1.0, b + x, c + h, d + x * x, e + x * h, f + h * h
                p, q, r = p + y, q + x * y, r + h * y
    # elimination: the prior makes the matrix positive definite
    d, e, f, q, r = d - b / a * b, e - b / a * c, f - c / a * c, q - b / a * p, r - c / a * p
    bend = (r - e / d * q) / (f - e / d * e)
    slope = (q - e * bend) / d
    return ((p - b * slope - c * bend) / a, slope, bend), width_m, either / count
