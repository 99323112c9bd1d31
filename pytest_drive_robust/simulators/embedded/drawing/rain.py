"""Rain streaks over a finished picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["draw_rain"]

_STREAKS_PER_PIXEL = 0.004
_LENGTH_SHARE = 0.07
_OPACITY = 0.3


@njit(cache=True)
def draw_rain(image: NDArray[np.uint8], tick: int, strength: float) -> None:
    """Thin bright streaks, `strength` 0..1 of the densest; a function of `tick` and the picture's size only."""
    height, width = image.shape[0], image.shape[1]
    streaks = int(strength * _STREAKS_PER_PIXEL * height * width)
    for streak in range(streaks):
        word = (tick * 668265263 + streak * 374761393) & 0x7FFFFFFFFFFF
        word = ((word ^ (word >> 13)) * 1274126177) & 0x7FFFFFFFFFFF
        word ^= word >> 16
        column, row = word % width, (word // width) % height
        length = int(height * _LENGTH_SHARE * (0.4 + 0.6 * ((word >> 20) & 15) / 15.0)) + 1
        for step in range(length):
            at_row, at_column = row + step, column - step // 5
            if at_row >= height or at_column < 0:
                break
            for channel in range(3):
                value = image[at_row, at_column, channel]
                image[at_row, at_column, channel] = np.uint8(value + (205.0 - value) * _OPACITY)
