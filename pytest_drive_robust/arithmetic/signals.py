"""Means, interpolation and moving sums; operations run in the order of the source.

`numpy.interp` multiplies and adds in one expression of C, which a compiler may fuse; `numpy.convolve` goes through
BLAS; the built-in `sum` adds floats in another way since Python 3.12.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import fsum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def mean(values: Sequence[float] | Floats) -> float:
    """Return the mean of at least one value, independent of their order to the last bit (the sum is exact)."""
    return fsum(values) / len(values)


def interpolate(at: Floats, x: Floats, y: Floats) -> Floats:
    """Return `y` at the places `at` (n,), interpolated linearly: (n,), or (n, m) where `y` has m values per point.

    `x` is (k,), k >= 2, and grows from point to point; `y` is (k,) or (k, m). Before the first point the result is the
    first `y`, after the last point the last `y`.
    """
    import numpy as np

    before = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    shape = (len(at),) + (1,) * (y.ndim - 1)
    length, beyond = (x[before + 1] - x[before]).reshape(shape), (at - x[before]).reshape(shape)
    inside = (y[before + 1] - y[before]) / length * beyond + y[before]
    inside[at <= x[0]], inside[at >= x[-1]] = y[0], y[-1]
    return np.asarray(inside)


def moving_sum(values: Floats, weights: Sequence[float] | Floats) -> Floats:
    """Return the weighted sum of each window of `values` (..., n): (..., n - k + 1) for k weights, k from 1 to n.

    The first weight goes to the first value of a window, and the products are added from the first to the last.
    """
    places = values.shape[-1] - len(weights) + 1
    total: Floats = weights[0] * values[..., :places]
    for k in range(1, len(weights)):
        total = total + weights[k] * values[..., k : k + places]
    return total
