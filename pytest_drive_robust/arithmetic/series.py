"""The polynomials behind the elementary functions: one text for floats, arrays and compiled code.

Methods and coefficients are those that fdlibm published (Sun Microsystems, "Freely Distributable LIBM", 1993), with a
reduction of angles that needs no branch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Number = TypeVar("Number", float, "NDArray[np.float64]")

LARGEST_ANGLE_RAD = 1.0e6
"""Up to this angle the sine, cosine and tangent hold their error bound."""

TURN = 6.283185307179586
PI_LOW = 1.2246467991473532e-16  # what pi lacks as a double
ROOT_OF_HALF = 0.7071067811865476
_ROUNDER = 6755399441055744.0  # 1.5 * 2**52: a double of that size has no room for a fraction
_PER_QUARTER = 0.6366197723675814  # 2 / pi
# pi / 2 in three parts: the first two have 33 bits, so that their products with a whole number below 2**20 are exact
_QUARTER_1, _QUARTER_2, _QUARTER_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # the first has 33 bits


def nearest_whole(x: Number) -> Number:
    """Return the whole number nearest to `x`, |x| < 2**51, ties to even."""
    return (x + _ROUNDER) - _ROUNDER


def wrap_angle(x: Number) -> Number:
    """Return `x` rad without its whole turns, from -pi to pi; unchanged within that range."""
    return x - TURN * nearest_whole(x / TURN)


def quarter_turns(x: Number) -> tuple[Number, Number, Number]:
    """Return (quarter, y, tail): the angle `x` is whole turns plus `quarter` quarter turns plus `y + tail`.

    `x` is in rad and at most `LARGEST_ANGLE_RAD`; `quarter` is from -2 to 2, |y| <= pi / 4.
    """
    count = nearest_whole(x * _PER_QUARTER)
    first, part = x - count * _QUARTER_1, count * _QUARTER_2
    rest = first - part
    back = rest - first
    lost = (first - (rest - back)) - (part + back)  # rest + lost is first - part without an error
    low = count * _QUARTER_3 - lost
    y = rest - low
    return count - 4.0 * nearest_whole(0.25 * count), y, (rest - y) - low


def sine(y: Number, tail: Number) -> Number:
    """Return the sine of `y + tail`, |y| <= pi / 4."""
    z = y * y
    odd = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    cube = z * y
    return y - ((z * (0.5 * tail - cube * odd) - tail) - cube * -1.66666666666666324348e-01)


def cosine(y: Number, tail: Number) -> Number:
    """Return the cosine of `y + tail`, |y| <= pi / 4."""
    z = y * y
    even = z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
            )
        )
    )
    half = 0.5 * z
    near = 1.0 - half
    return near + (((1.0 - near) - half) + (z * even - y * tail))


def arctangent(t: Number, high: Number, low: Number) -> Number:
    """Return the arctangent of `t` plus `high + low`, |t| <= 7 / 16."""
    z = t * t
    w = z * z
    odd = z * (
        3.33333333333329318027e-01
        + w
        * (
            1.42857142725034663711e-01
            + w
            * (
                9.09088713343650656196e-02
                + w * (6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02))
            )
        )
    )
    even = w * (
        -1.99999999998764832476e-01
        + w
        * (
            -1.11111104054623557880e-01
            + w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))
        )
    )
    return high - ((t * (odd + even) - low) - t)


def exponential(x: Number) -> tuple[Number, Number]:
    """Return (y, twos): the exponential of `x` is `y * 2**twos`, |x| < 800, `twos` a whole number."""
    twos = nearest_whole(x * 1.4426950408889634)
    high, low = x - twos * _LN2_HIGH, twos * _LN2_LOW
    rest = high - low
    z = rest * rest
    c = rest - z * (
        1.66666666666666019037e-01
        + z
        * (
            -2.77777777770155933842e-03
            + z * (6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))
        )
    )
    return 1.0 - ((low - (rest * c) / (2.0 - c)) - high), twos


def logarithm(f: Number, twos: Number) -> Number:
    """Return the natural logarithm of `(1 + f) * 2**twos`, `1 + f` between the square roots of 0.5 and 2."""
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    odd = z * (
        6.666666666666735130e-01
        + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))
    )
    half = 0.5 * f * f
    return twos * _LN2_HIGH - ((half - (s * (half + (odd + even)) + twos * _LN2_LOW)) - f)


def small_sinh(x: Number) -> Number:
    """Return the hyperbolic sine of `x`, |x| <= 1: Taylor's series, whose next term is below 2**-60."""
    z = x * x
    tail = 1.0 / 6227020800.0 + z * (
        1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0 + z * (1.0 / 121645100408832000.0))
    )
    tail = 1.0 / 120.0 + z * (1.0 / 5040.0 + z * (1.0 / 362880.0 + z * (1.0 / 39916800.0 + z * tail)))
    return x + x * z * (1.0 / 6.0 + z * tail)
