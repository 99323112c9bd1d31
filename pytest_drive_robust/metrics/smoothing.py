"""Savitzky-Golay filters of second order as weighted sums: what `scipy.signal.savgol_filter` does with
`mode="interp"`, without an import of a quarter of a second and a least-squares fit for every signal.

Around each sample a parabola is fitted to a window of samples; near the ends it is that of the first or last window.
Source of the closed form: Savitzky and Golay, Analytical Chemistry 36 (1964), as corrected by Steinier et al. (1972).
"""

from __future__ import annotations

import functools
from math import fsum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["parabola_filter"]


def parabola_filter(values: Floats, window: int, *, derivative: int, step_s: float) -> Floats:
    """Return `values` (..., samples) smoothed (`derivative` 0), or their slope per second (1), of the same shape.

    Windows of 3 or more samples and at most as many as there are; an even one must be all of them. `step_s` is the
    time between two samples.
    """
    import numpy as np

    first, weights = _windows(values.shape[-1], window, derivative)
    filtered: Floats = weights[:, 0] * values[..., first]
    for k in range(1, window):
        filtered = filtered + weights[:, k] * values[..., first + k]
    return np.asarray(filtered / step_s) if derivative else filtered


@functools.lru_cache(maxsize=64)
def _windows(samples: int, window: int, derivative: int) -> tuple[NDArray[np.int64], Floats]:
    """Return for each sample where its window begins, (samples,), and the weights of it, (samples, window)."""
    import numpy as np

    within = np.arange(window) - (window - 1) / 2.0
    second = within * within
    squares, fourths = fsum(second), fsum(second * second)
    spread = window * fourths - squares * squares
    first = np.clip(np.arange(samples) - window // 2, 0, samples - window)
    at = within[np.arange(samples) - first][:, None]
    if derivative:
        return first, within / squares + 2.0 * at * (window * second - squares) / spread
    bent = fourths - squares * second + at * at * (window * second - squares)
    return first, bent / spread + at * within / squares
