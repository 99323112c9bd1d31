"""Elementary functions of arrays, bit for bit those of `scalars`, for any shape; numbers and lists count as arrays.

Each function uses numpy operations that round correctly, one at a time. No function warns: an undefined result is NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pytest_drive_robust.arithmetic.series import (
    LARGEST_ANGLE_RAD,
    PI_LOW,
    ROOT_OF_HALF,
    TURN,
    arctangent,
    cosine,
    exponential,
    logarithm,
    quarter_turns,
    sine,
    small_sinh,
)
from pytest_drive_robust.jit.arrays import Floats

_quiet = np.errstate(all="ignore")  # branches that are computed and not chosen

_BOUNDS = np.array((0.4375, 0.6875, 1.1875, 2.4375))
_PARTS = np.array(
    (
        *((1.0, 2.0, 1.0, 1.0, 0.0), (0.0, -1.0, -1.0, -1.5, -1.0)),
        *((0.0, 1.0, 1.0, 1.5, 1.0), (1.0, 2.0, 1.0, 1.0, 0.0)),
        (0.0, 0.4636476090008061, 0.7853981633974483, 0.982793723247329, 1.5707963267948966),
        (0.0, 2.2698777452961687e-17, 3.061616997868383e-17, 1.3903311031230998e-17, 6.123233995736766e-17),
    )
)
"""For each stretch of the arctangent: a, b, c, d of `(a * x + b) / (c * x + d)`, and its angle in two parts."""


def _floats(x: ArrayLike) -> Floats:
    return np.asarray(x, np.float64)


def _usual_angles(x: ArrayLike) -> Floats:
    """Return `x` rad, with angles beyond `LARGEST_ANGLE_RAD` reduced by whole turns; NaN for infinity and NaN."""
    angles = _floats(x)
    large = ~(np.abs(angles) <= LARGEST_ANGLE_RAD)
    if not large.any():
        return angles
    return np.where(large, angles % TURN, angles)


@_quiet
def sin(x: ArrayLike) -> Floats:
    """Return the sine of each of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angles(x))
    value = np.where(quarter * quarter != 1.0, sine(y, tail), cosine(y, tail))
    return np.where((quarter == 0.0) | (quarter == 1.0), value, -value)


@_quiet
def cos(x: ArrayLike) -> Floats:
    """Return the cosine of each of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angles(x))
    value = np.where(quarter * quarter != 1.0, cosine(y, tail), sine(y, tail))
    return np.where((quarter == 0.0) | (quarter == -1.0), value, -value)


@_quiet
def atan(x: ArrayLike) -> Floats:
    """Return the arctangent of each of `x` in rad, from -pi / 2 to pi / 2."""
    x = _floats(x)
    size = np.abs(x)
    part = np.searchsorted(_BOUNDS, size, side="right")
    a, b, c, d, high, low = _PARTS[:, part]
    size = np.minimum(size, 1e300)  # beyond 1e300 the result is pi / 2 in any case
    angle: Floats = np.copysign(arctangent((a * size + b) / (c * size + d), high, low), x)
    return angle


@_quiet
def atan2(y: ArrayLike, x: ArrayLike) -> Floats:
    """Return the direction of each point (x, y) in rad, from -pi to pi."""
    y, x = np.broadcast_arrays(_floats(y), _floats(x))
    beside, ahead = np.abs(y), np.abs(x)
    same, upright = (beside == ahead) & (beside > 0.0), ahead == 0.0
    plain = same | upright
    angle = atan(np.where(plain, 0.0, beside) / np.where(plain, 1.0, ahead))
    angle = np.where(upright, np.where(beside > 0.0, 1.5707963267948966, beside), angle)
    angle = np.where(same, 0.7853981633974483, angle)
    angle = np.where(np.copysign(1.0, x) < 0.0, np.pi - (angle - PI_LOW), angle)
    directed: Floats = np.copysign(angle, y)
    return directed


@_quiet
def exp(x: ArrayLike) -> Floats:
    """Return e to the power of each of `x`."""
    x = _floats(x)
    usual = (x <= 709.782712893384) & (x >= -745.2)
    y, twos = exponential(np.where(usual, x, 0.0))
    value = np.ldexp(y, twos.astype(np.int32))
    return np.where(usual, value, np.where(x > 0.0, np.inf, np.where(x < 0.0, 0.0, x)))


@_quiet
def log(x: ArrayLike) -> Floats:
    """Return the natural logarithm of each of `x`."""
    x = _floats(x)
    usual = (x > 0.0) & (x < np.inf)
    part, whole = np.frexp(np.where(usual, x, 1.0))
    small, twos = part < ROOT_OF_HALF, whole.astype(np.float64)
    value = logarithm(np.where(small, 2.0 * part, part) - 1.0, np.where(small, twos - 1.0, twos))
    return np.where(usual, value, np.where(x == 0.0, -np.inf, np.where(x > 0.0, x, np.nan)))


@_quiet
def power(x: ArrayLike, y: ArrayLike) -> Floats:
    """Return each of `x` to the power of `y`, `x` >= 0."""
    x, y = np.broadcast_arrays(_floats(x), _floats(y))
    plain = (y == 0.0) | (x == 1.0)
    return np.where(plain, 1.0, exp(np.where(plain, 0.0, y) * log(np.where(plain, 1.0, x))))


@_quiet
def hypot(x: ArrayLike, y: ArrayLike) -> Floats:
    """Return the length of each (x, y). Parts must be below 1e150; a part below 1e-150 counts as 0."""
    x, y = _floats(x), _floats(y)
    length: Floats = np.sqrt(x * x + y * y)
    return length


@_quiet
def sinh(x: ArrayLike) -> Floats:
    """Return the hyperbolic sine of each of `x`."""
    x = _floats(x)
    size = np.abs(x)
    small = size <= 1.0
    large = exp(np.where(small, 1.0, size))
    return np.where(small, small_sinh(np.where(small, x, 0.0)), np.copysign(0.5 * large - 0.5 / large, x))
