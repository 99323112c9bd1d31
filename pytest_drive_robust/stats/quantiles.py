"""The normal and Student's t distribution, for whole degrees of freedom, in closed form.

Replaces `ndtri`, `stdtr` and `stdtrit` of `scipy.special`, whose import takes a seventh of a second. Chances are
right to 1e-14, quantiles to a relative 1e-11 for chances of 1e-4 to 1 - 1e-4.
"""

from __future__ import annotations

import functools
import math


def normal_quantile(chance: float) -> float:
    """Return the quantile of the standard normal distribution at `chance`, between 0 and 1."""
    from statistics import NormalDist  # imported late: `statistics` imports decimal arithmetic and fractions

    return NormalDist().inv_cdf(chance)


def student_t_chance(degrees_of_freedom: int, value: float) -> float:
    """Return the chance that Student's t with 1 or more `degrees_of_freedom` is `value` or less."""
    angle = math.atan(value / math.sqrt(degrees_of_freedom))
    return min(1.0, max(0.0, 0.5 + 0.5 * _between(degrees_of_freedom, angle)))


@functools.cache
def student_t_quantile(degrees_of_freedom: int, chance: float) -> float:
    """Return the quantile of Student's t with 1 or more `degrees_of_freedom` at `chance`, between 0 and 1."""
    wanted = abs(2.0 * chance - 1.0)
    low, high = 0.0, math.pi / 2.0
    while low < (middle := 0.5 * (low + high)) < high:
        if _between(degrees_of_freedom, middle) < wanted:
            low = middle
        else:
            high = middle
    return math.copysign(math.sqrt(degrees_of_freedom) * math.tan(low), chance - 0.5)


def _between(degrees_of_freedom: int, angle: float) -> float:
    """Return the chance of a t between -v and v for `angle` = atan(v / sqrt(degrees of freedom)); negative for v < 0.

    Source: Abramowitz and Stegun 1972, "Handbook of Mathematical Functions", 26.7.3 and 26.7.4.
    """
    cosine, series = math.cos(angle), 0.0
    square = cosine * cosine
    for factor in _factors(degrees_of_freedom):
        series = series * square + factor
    series *= math.sin(angle)
    return 2.0 / math.pi * (angle + series * cosine) if degrees_of_freedom % 2 else series


@functools.cache
def _factors(degrees_of_freedom: int) -> tuple[float, ...]:
    """Return the factors of the powers of cos(angle) ** 2, the highest power first."""
    factors, factor, odd = [], 1.0, degrees_of_freedom % 2
    for number in range(2 + odd, degrees_of_freedom + 1, 2):
        factors.append(factor)
        factor *= (number - 1) / number
    return tuple(reversed(factors))
