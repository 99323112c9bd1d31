"""Checks of severities: a severity that no sensor or computer can have is refused when the perturbation is built."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable

from pytest_drive_robust.errors import PerturbationError, did_you_mean

_ROUNDING = 1e-9  # 100 ms / 50 ms must be 2 ticks, although 0.1 / 0.05 may come out a hair below 2


def checked_number(
    owner: object, name: str, *, expected: str, low: float = 0.0, high: float = math.inf, above_low: bool = False
) -> float:
    """Return the field `name` of `owner` as a finite float in `low..high` (`above_low`: without `low` itself).

    Raises `PerturbationError` with the value and `expected`, which names the unit and the range for people.
    """
    value = getattr(owner, name)
    if _is_number(value):
        number = float(value)
        if math.isfinite(number) and low <= number <= high and not (above_low and number == low):
            return number
    raise refusal(owner, name, expected)


def checked_count(owner: object, name: str, *, expected: str, low: int = 0) -> int:
    """Return the field `name` of `owner` as an int of at least `low`. Raises `PerturbationError`."""
    value = getattr(owner, name)
    if _is_number(value):
        number = float(value)
        if number.is_integer() and number >= low:
            return int(number)
    raise refusal(owner, name, expected)


def checked_numbers(owner: object, name: str, *, expected: str) -> tuple[float, ...]:
    """Return the field `name` of `owner` as a tuple of finite floats of at least 0. Raises `PerturbationError`."""
    values = getattr(owner, name)
    if isinstance(values, Iterable):
        values = tuple(values)
        if all(_is_number(value) and math.isfinite(value) and value >= 0.0 for value in values):
            return tuple(map(float, values))
    raise refusal(owner, name, expected)


def checked_flag(owner: object, name: str) -> bool:
    """Return the field `name` of `owner` as a bool. Raises `PerturbationError`."""
    value = getattr(owner, name)
    if isinstance(value, bool):
        return value
    raise refusal(owner, name, "True or False")


def checked_choice(owner: object, name: str, choices: tuple[str, ...]) -> str:
    """Return the field `name` of `owner` as one of `choices`. Raises `PerturbationError` with the nearest choice."""
    value = getattr(owner, name)
    if isinstance(value, str) and value in choices:
        return value
    raise refusal(owner, name, f"one of {', '.join(map(repr, choices))}.{did_you_mean(str(value), choices)}")


def whole_ticks(duration_s: float, dt_s: float) -> int:
    """Count the whole ticks in `duration_s`: `floor(ms * SIM_RATE / 1000)` of the paper, safe against rounding.

    >>> whole_ticks(0.1, 0.05), whole_ticks(0.149, 0.05), whole_ticks(0.3, 0.1)
    (2, 2, 3)
    """
    ticks = duration_s / dt_s
    return math.floor(ticks + _ROUNDING * max(1.0, ticks))


def delay_ticks(owner: object, name: str, duration_s: float, dt_s: float) -> int:
    """Count whole ticks. Raises `PerturbationError` for a duration between 0 and one tick, which would do nothing."""
    ticks = whole_ticks(duration_s, dt_s)
    if ticks == 0 and duration_s > 0.0:
        rate = f"{1000.0 * duration_s:g} ms is 0 ticks at {1.0 / dt_s:g} Hz"
        raise refusal(owner, name, f"0 or at least one tick, which lasts {dt_s:g} s in this simulator: {rate}")
    return ticks


def refusal(owner: object, name: str, expected: str) -> PerturbationError:
    """Return the error to raise when the field `name` of `owner` is not what was `expected`."""
    return PerturbationError(f"{type(owner).__name__}: {name} is {getattr(owner, name)!r}, expected {expected}")


def _is_number(value: object) -> bool:
    """Return True for a real number that fits into a float: a whole number may be too large."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True
