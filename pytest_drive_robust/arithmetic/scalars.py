"""Elementary functions of floats, in plain Python; `compiled` makes kernels of the same text.

Each result is at most 1 unit in the last place off, 2 for `tan`, `atan2` and `sinh`; `power` says its own
bound. Sine, cosine and tangent keep it up to `LARGEST_ANGLE_RAD`; a larger angle is first reduced by the double
nearest to a whole turn. As in numpy, an undefined result is NaN and a result that is too large is infinite: no function
raises.
"""

from __future__ import annotations

import math

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


def _usual_angle(x: float) -> float:
    """Return `x` rad, reduced by whole turns beyond `LARGEST_ANGLE_RAD`; NaN for infinity and NaN."""
    return x if abs(x) <= LARGEST_ANGLE_RAD else x % TURN


def sin(x: float) -> float:
    """Return the sine of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    value = sine(y, tail) if quarter * quarter != 1.0 else cosine(y, tail)
    return value if quarter == 0.0 or quarter == 1.0 else -value


def cos(x: float) -> float:
    """Return the cosine of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    value = cosine(y, tail) if quarter * quarter != 1.0 else sine(y, tail)
    return value if quarter == 0.0 or quarter == -1.0 else -value


def cos_sin(x: float) -> tuple[float, float]:
    """Return the cosine and the sine of `x` rad, as each by itself."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    along, beside = cosine(y, tail), sine(y, tail)
    if quarter * quarter == 1.0:
        return -quarter * beside, quarter * along
    return (along, beside) if quarter == 0.0 else (-along, -beside)


def tan(x: float) -> float:
    """Return the tangent of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    above, below = sine(y, tail), cosine(y, tail)
    return above / below if quarter * quarter != 1.0 else -below / above


def atan(x: float) -> float:
    """Return the arctangent of `x` in rad, from -pi / 2 to pi / 2."""
    x = float(x)
    size = abs(x)
    if size < 0.4375:
        t, high, low = size, 0.0, 0.0
    elif size < 0.6875:
        t, high, low = (2.0 * size - 1.0) / (2.0 + size), 0.4636476090008061, 2.2698777452961687e-17
    elif size < 1.1875:
        t, high, low = (size - 1.0) / (size + 1.0), 0.7853981633974483, 3.061616997868383e-17
    elif size < 2.4375:
        t, high, low = (size - 1.5) / (1.0 + 1.5 * size), 0.982793723247329, 1.3903311031230998e-17
    else:
        t, high, low = -1.0 / size, 1.5707963267948966, 6.123233995736766e-17
    return math.copysign(arctangent(t, high, low), x)


def atan2(y: float, x: float) -> float:
    """Return the direction of the point (x, y) in rad, from -pi to pi; signs of zero count as in `math.atan2`."""
    y, x = float(y), float(x)
    beside, ahead = abs(y), abs(x)
    if beside == ahead and beside > 0.0:
        angle = 0.7853981633974483
    elif ahead == 0.0:
        angle = 1.5707963267948966 if beside > 0.0 else beside
    else:
        angle = atan(beside / ahead)
    if math.copysign(1.0, x) < 0.0:
        angle = math.pi - (angle - PI_LOW)
    return math.copysign(angle, y)


def exp(x: float) -> float:
    """Return e to the power of `x`."""
    x = float(x)
    if x > 709.782712893384:
        return math.inf
    if x < -745.2:
        return 0.0
    if x != x:
        return x
    y, twos = exponential(x)
    return math.ldexp(y, int(twos))


def log(x: float) -> float:
    """Return the natural logarithm of `x`."""
    x = float(x)
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else (x if x > 0.0 else math.nan)
    part, twos = math.frexp(x)
    if part < ROOT_OF_HALF:
        part, twos = 2.0 * part, twos - 1
    return logarithm(part - 1.0, float(twos))


def power(x: float, y: float) -> float:
    """Return `x` to the power of `y`, `x` >= 0; at most `2 + 2 * |y * log(x)|` units in the last place off."""
    x, y = float(x), float(y)
    if y == 0.0 or x == 1.0:
        return 1.0
    return exp(y * log(x))


def hypot(x: float, y: float) -> float:
    """Return the length of (x, y). Both parts must be below 1e150; a part below 1e-150 counts as 0."""
    x, y = float(x), float(y)
    return math.sqrt(x * x + y * y)


def sinh(x: float) -> float:
    """Return the hyperbolic sine of `x`."""
    x = float(x)
    if abs(x) <= 1.0:
        return small_sinh(x)
    large = exp(abs(x))
    return math.copysign(0.5 * large - 0.5 / large, x)
