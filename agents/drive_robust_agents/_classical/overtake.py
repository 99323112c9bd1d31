"""Overtake a body that stands in the own lane: wait for a gap in the lane to the left, pass, come back."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._classical.gap import Gap
from drive_robust_agents._vehicle.mkz import TICK_S
from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["Overtake"]

_LANE_M = 3.4
"""From the middle of the own lane to that of the lane to the left."""
_SLOPE = 0.5
"""Metres to the side per metre ahead when pulling out and in."""
_BLOCKED_M, _BLOCKED_HALF_M = 16.0, 1.4
"""A body this near ahead, and this near to the middle of the lane, blocks it."""
_STANDING_MPS, _MOVED_M = 0.3, 0.4
"""Speed below which the vehicle stands, and motion of the body between two calls below which it stands, too."""
_WAIT_S = 1.0
"""Least time of waiting behind the body."""
_LEFT_LANE_M = (-4.7, -2.3)
"""Metres to the right between which a body is in the lane to the left."""
_BESIDE_M, _NEXT_M = 8.0, 22.0
"""The way past a body ends after this length without another body within `_NEXT_M`."""
_SAME_M, _DRIVEN_M, _AHEAD_M = 0.8, 2.0, 9.0
"""The body has driven off when its nearest point, in steps below `_SAME_M`, has moved by `_DRIVEN_M` and is `_AHEAD_M`
ahead."""
_LAMPS = (slice(73, 120), slice(90, 166))
"""Rows and columns of the picture in which brake lamps of a vehicle right ahead are."""
_LAMP_RED, _LAMP_PX = 235, 2
"""Least red (0..255) of a brake lamp's pixel, and the least number of such pixels."""


class Overtake:
    """The state of overtaking: `offset_m` is the path's present offset from the own lane, negative to the left."""

    def __init__(self) -> None:
        self.offset_m = 0.0
        self.passing = False
        self._gap = Gap()
        self._blocked_m, self._waited_s, self._clear_m, self._driven_m = math.inf, 0.0, 0.0, 0.0

    def offsets(self, points: int) -> Floats:
        """Return the offset of each path point, one a metre, from the present to the wanted offset [m]."""
        wanted = -_LANE_M if self.passing else 0.0
        reach = _SLOPE * np.arange(points)
        moved: Floats = self.offset_m + np.clip(wanted - self.offset_m, -reach, reach)
        return moved

    def update(
        self, pixels: Pixels, along_m: Floats, right_m: Floats, *, speed_mps: float, ticks: int,
        allowed: bool,
    ) -> None:  # fmt: skip
        """Update the decision from foreign points in metres along the own lane and to its right.

        `ticks` have passed since the last call. Overtaking is not `allowed` near junctions.
        """
        travelled_m = speed_mps * (ticks * TICK_S)
        wanted = -_LANE_M if self.passing else 0.0
        most = _SLOPE * abs(travelled_m)
        self.offset_m += min(max(wanted - self.offset_m, -most), most)
        own = np.sort(along_m[(np.abs(right_m) < _BLOCKED_HALF_M) & (along_m > 0.0)])
        first = float(own[1]) if len(own) >= 2 else math.inf
        if self.passing:
            self._clear_m = 0.0 if first < _NEXT_M else self._clear_m + travelled_m
            self.passing = allowed and self._clear_m < _BESIDE_M and not self._drives_off(first, travelled_m)
        elif allowed:
            left = along_m[(right_m > _LEFT_LANE_M[0]) & (right_m < _LEFT_LANE_M[1])]
            self._wait(first, left, pixels, speed_mps, ticks)
        else:
            self._waited_s = 0.0

    def _wait(self, first_m: float, left_m: Floats, pixels: Pixels, speed_mps: float, ticks: int) -> None:
        """Wait behind a body that does not move, then for a gap in the lane to the left."""
        still = first_m < _BLOCKED_M and speed_mps < _STANDING_MPS and abs(first_m - self._blocked_m) < _MOVED_M
        still = still and not _brakes(pixels)
        self._blocked_m = first_m
        self._waited_s = self._waited_s + ticks * TICK_S if still else 0.0
        if not still:
            self._gap = Gap()
        elif self._gap.open(left_m, pixels, ticks) and self._waited_s > _WAIT_S:
            self.passing, self._clear_m, self._waited_s, self._driven_m = True, 0.0, 0.0, 0.0

    def _drives_off(self, first_m: float, travelled_m: float) -> bool:
        """Return whether the body in the way has started to drive."""
        moved = first_m - (self._blocked_m - travelled_m)
        self._driven_m = self._driven_m + moved if abs(moved) < _SAME_M else 0.0
        self._blocked_m = first_m
        return self._driven_m > _DRIVEN_M and first_m > _AHEAD_M


def _brakes(pixels: Pixels) -> bool:
    """Return whether a vehicle right ahead shows brake lamps, and will therefore drive on."""
    ahead = pixels[_LAMPS].astype(np.int16)
    red, green, blue = ahead[:, :, 0], ahead[:, :, 1], ahead[:, :, 2]
    lit = (red >= _LAMP_RED) & (red > 3 * np.maximum(green, blue))
    return int(np.count_nonzero(lit)) >= _LAMP_PX
