"""Savitzky-Golay filters of second order as one small matrix: what `scipy.signal.savgol_filter` does with
`mode="interp"`, without an import of a quarter of a second and a least-squares fit for every signal.

Around each sample a parabola is fitted to a window of samples; near the ends it is that of the first or last window.
Source of the closed form: Savitzky and Golay, Analytical Chemistry 36 (1964), as corrected by Steinier et al. (1972).
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["parabola_filter"]


def parabola_filter(values: Floats, window: int, *, derivative: int, step_s: float) -> Floats:
    """`values` (..., samples) smoothed (`derivative` 0) or their slope per second (1), of the same shape.

    Windows of 3 or more samples and at most as many as there are; an even one must be all of them. `step_s` is the
    time between two samples.
    """
    filtered: Floats = values @ _weights(values.shape[-1], window, derivative)
    return filtered / step_s if derivative else filtered


@functools.lru_cache(maxsize=64)
def _weights(samples: int, window: int, derivative: int) -> Floats:
    """Return (samples, samples): the weights of all samples in column i give the value at sample i."""
    import numpy as np

    within = np.arange(window) - (window - 1) / 2.0
    squares, fourths = (within**2).sum(), (within**4).sum()
    spread = window * fourths - squares**2
    weights = np.zeros((samples, samples))
    for sample in range(samples):
        first = min(max(sample - window // 2, 0), samples - window)
        at = within[sample - first]
        if derivative:
            fitted = within / squares + 2.0 * at * (window * within**2 - squares) / spread
        else:
            bent = fourths - squares * within**2 + at**2 * (window * within**2 - squares)
            fitted = bent / spread + at * within / squares
        weights[first : first + window, sample] = fitted
    return weights
