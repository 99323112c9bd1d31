"""Follows the markings of the own lane in a band of ground ahead: offset, heading and curvature of its middle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._classical.vision import ground_pixels

__all__ = ["LaneTracker"]

Floats = NDArray[np.float64]

_RIGHT_STEP_M = 0.12
_RIGHT_M = np.arange(-5.4, 5.41, _RIGHT_STEP_M)
_FLANK = 3
"""Samples (0.36 m) to both sides that must be darker than a marking: a zebra bar is wider than that."""
_GATE_M = 0.7
_CONTRAST = 0.22
_PRIOR = np.diag([6.0, 400.0, 30000.0])
_WIDTH_M = (3.1, 4.0)


class LaneTracker:
    """The middle of the lane is `y = c0 + c1 x + c2 x^2 / 2`, metres forward (x) and to the right (y)."""

    FORWARD_M: Floats = np.arange(5.0, 19.0, 0.6)
    """Metres ahead of the vehicle's middle at which markings are looked for."""

    def __init__(self) -> None:
        grid = np.meshgrid(self.FORWARD_M, _RIGHT_M, indexing="ij")
        self._rows, self._columns = ground_pixels(*grid)
        self._basis = np.column_stack((np.ones_like(self.FORWARD_M), self.FORWARD_M, 0.5 * self.FORWARD_M**2))
        self.forget(0.0, 0.0)

    def forget(self, offset_m: float, slope: float) -> None:
        """Start again from a guess of the lane's offset and slope."""
        self._state: Floats = np.array([offset_m, slope, 0.0])
        self._width_m = 3.5
        self.quality = 0.0

    def middle(self, forward_m: Floats) -> Floats:
        """Return the lane's middle, metres to the right, at these metres ahead."""
        forward = np.clip(forward_m, 0.0, 22.0)
        middle: Floats = self._state[0] + self._state[1] * forward + 0.5 * self._state[2] * forward**2
        return middle

    def move(self, travelled_m: float, turned_rad: float) -> None:
        """Carry the lane along with the vehicle's own motion."""
        offset, slope, bend = self._state
        self._state = np.array([offset + slope * travelled_m, slope + bend * travelled_m - turned_rad, bend])

    def see(self, pixels: NDArray[np.uint8], asphalt: Floats) -> None:
        """Correct the lane by the markings of one image.

        `asphalt` is the brightness of the road (green, 0..255) at `LaneTracker.FORWARD_M`.
        """
        green = pixels[self._rows, self._columns, 1].astype(np.float32)
        inner = green[:, _FLANK:-_FLANK]
        ridge = inner - np.maximum(green[:, : -2 * _FLANK], green[:, 2 * _FLANK :])
        middle = self._basis @ self._state
        found: list[Floats] = []
        weights: list[Floats] = []
        for side in (-0.5, 0.5):
            right, strong = _peaks(ridge, middle + side * self._width_m, _CONTRAST * asphalt)
            found.append(right)
            weights.append(strong)
        self._fit(found, weights)

    def _fit(self, found: list[Floats], weights: list[Floats]) -> None:
        left, right = weights
        both = (left > 0.0) & (right > 0.0)
        if both.sum() >= 3:
            width = float(np.median(found[1][both] - found[0][both]))
            self._width_m = float(np.clip(0.9 * self._width_m + 0.1 * width, *_WIDTH_M))
        information, pull = _PRIOR.copy(), _PRIOR @ self._state
        for side, places, strong in zip((-0.5, 0.5), found, weights, strict=True):
            weighted = self._basis * strong[:, None]
            information += weighted.T @ self._basis
            pull += weighted.T @ (places - side * self._width_m)
        self._state = np.linalg.solve(information, pull)
        seen = float(np.mean(np.maximum(left, right)))
        self.quality += 0.1 * (seen - self.quality)


def _peaks(ridge: NDArray[np.float32], expected_m: Floats, least: Floats) -> tuple[Floats, Floats]:
    """Return (places, weights) of the strongest ridge near the expected place of each row; weight 0 without one."""
    reach = int(_GATE_M / _RIGHT_STEP_M)
    first = np.round((expected_m - _RIGHT_M[_FLANK]) / _RIGHT_STEP_M).astype(np.int64) - reach
    inside = (first >= 0) & (first + 2 * reach < ridge.shape[1])
    window = np.clip(first, 0, ridge.shape[1] - 2 * reach - 1)[:, None] + np.arange(2 * reach + 1)
    near = np.take_along_axis(ridge, window, axis=1)
    peak = np.argmax(near - 0.3 * least[:, None] * np.abs(np.arange(-reach, reach + 1)) / reach, axis=1)
    rows = np.arange(len(ridge))
    strong = ((near[rows, peak] > least) & inside).astype(np.float64)
    return _RIGHT_M[_FLANK + window[rows, peak]], strong
