"""Decide when to enter the lane to the left from standing, by the traffic near ahead and the motion far ahead."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._vehicle.mkz import TICK_S
from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["Gap"]

_LOOK_M, _PASSED_M, _JUMP_M = 46.0, 12.0, 3.0
"""How far ahead the lane is looked at, the distance ahead below which a vehicle is just passing, and the step of the
nearest point above which it belongs to another vehicle."""
_JUST_S, _NOBODY_S = 1.2, 6.0
"""For how long after a vehicle has passed the gap is open, and after how long without any vehicle."""
_SLOW_S = 1.6
"""Longest time for one vehicle to pass; a longer passage means that more vehicles follow closely."""
_DRIFT_M = 0.1
"""Least motion of a driving vehicle in a tick."""
_FAR_ROWS, _FAR_COLUMNS = slice(71, 78), slice(108, 127)
"""Pixels that show the lane to the left 40 to 100 m ahead on a straight road."""
_ADAPT, _DIFFERENT, _SMOOTH, _MOVING_PX = 0.03, 20.0, 0.3, 5.0
"""Motion far ahead: share of a new picture in the scene, difference of brightness that counts as motion, share of a new
count in the mean, and the mean of pixels from which something moves."""


class Gap:
    """A gap in the left lane: open right after a vehicle has passed, or when none has passed for a while.

    The front camera sees nothing behind the vehicle. Vehicles ahead in that lane must drive away; in an oncoming lane
    nothing may move far ahead.
    """

    def __init__(self) -> None:
        self._nearest_m, self._drift_m, self._since_s = math.inf, 0.0, _JUST_S
        self._near_s = 0.0
        self._same_way = False
        self._scene: NDArray[np.float32] | None = None
        self._moving_px = 0.0

    def open(self, along_m: Floats, pixels: Pixels, ticks: int) -> bool:
        """Return whether the gap is open, from the lane's foreign points (metres ahead) and the picture.

        `ticks` have passed since the last call.
        """
        elapsed_s = ticks * TICK_S
        ahead = np.sort(along_m[(along_m > 1.0) & (along_m < _LOOK_M)])
        nearest = float(ahead[1]) if len(ahead) >= 2 else math.inf
        moved = nearest - self._nearest_m
        same = math.isfinite(moved) and abs(moved) < _JUMP_M
        self._drift_m = 0.8 * self._drift_m + 0.2 * moved / ticks if same else 0.0
        self._nearest_m = nearest
        if abs(self._drift_m) > _DRIFT_M:
            self._same_way = self._drift_m > 0.0
        if nearest < _PASSED_M:
            self._near_s = self._near_s + elapsed_s if self._since_s < _JUST_S else 0.0
            self._since_s = 0.0
        else:
            self._since_s += elapsed_s
        self._look_far(pixels)
        leaves = nearest > _PASSED_M and self._drift_m > _DRIFT_M
        empty = nearest == math.inf and (self._same_way or self._moving_px < _MOVING_PX)
        just_passed = 0.1 < self._since_s < _JUST_S and self._near_s < _SLOW_S
        return (leaves or empty) and (just_passed or self._since_s > _NOBODY_S)

    def _look_far(self, pixels: Pixels) -> None:
        """Update the mean count of far pixels that differ from the picture of about a second ago."""
        window = pixels[_FAR_ROWS, _FAR_COLUMNS].max(axis=2).astype(np.float32)
        if self._scene is None:
            self._scene = window
        difference = window - self._scene
        self._scene = self._scene + np.float32(_ADAPT) * difference
        different = float(np.count_nonzero(np.abs(difference) > _DIFFERENT))
        self._moving_px += _SMOOTH * (different - self._moving_px)
