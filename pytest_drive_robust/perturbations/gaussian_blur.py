"""A Gaussian blur in whole numbers: the same bytes on every machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.observation import Pixels

__all__ = ["blurred"]

_TAPS = (20, 20, 19, 17, 15, 13, 10, 7, 6, 4, 3, 2, 1, 0, 1)
"""Right half of OpenCV's Gaussian of 31 taps (sigma 5) in 256ths, its rounding errors carried on from the outside."""


def blurred(pixels: Pixels) -> Pixels:
    """Blur (height, width, 3) uint8 by 31 x 31 pixels, mirrored at the edges: what `cv2.GaussianBlur` gives today."""
    import numpy as np

    across = _weighted(pixels.swapaxes(0, 1), np.uint16)  # at most 255 * 256
    down = _weighted(across.swapaxes(0, 1), np.uint32)
    return np.asarray((down + np.uint32(1 << 15)) >> np.uint32(16), np.uint8)


def _weighted(values: NDArray[np.unsignedinteger], kind: type[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """Return the weighted sums along the first axis, of this type."""
    import numpy as np

    reach, count = len(_TAPS) - 1, len(values)
    wide = values[_mirrored(count, reach)].astype(kind)
    total = wide[reach : reach + count] * kind(_TAPS[0])
    for step, tap in enumerate(_TAPS[1:], 1):
        if tap:
            total += (wide[reach - step : reach - step + count] + wide[reach + step : reach + step + count]) * kind(tap)
    return np.asarray(total)


def _mirrored(count: int, reach: int) -> NDArray[np.int64]:
    """Return the indices of a line with `reach` more at both ends, mirrored without repeating the edge."""
    import numpy as np

    places = np.arange(-reach, count + reach)
    period = max(2 * (count - 1), 1)
    places %= period
    return np.where(places < count, places, period - places)
