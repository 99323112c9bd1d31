"""Arithmetic that rounds as numpy does on this machine.

highway-env computes with numpy scalars and two-vectors, and numpy chooses its code by CPU: with AVX-512 its arctan2,
arcsin, arctan, tan and power are Intel's SVML (last bit unlike libm's), and a dot product goes through BLAS, which may
or may not fuse multiply and add. So we call numpy's own inner loops, and measure how products round.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.simulators.compat.compiled import arithmetic, kernel, sources_digest
from pytest_drive_robust.simulators.compat.loops import call1, call2, fma, loop_of

__all__ = [
    "arcsin",
    "arctan",
    "arctan2",
    "cos",
    "dot2",
    "dot3",
    "is_exact",
    "machine",
    "power",
    "scalar_power",
    "sin",
    "tan",
    "turn2",
]

Machine = NDArray[np.int64]
_UFUNCS = (np.sin, np.cos, np.tan, np.arcsin, np.arctan, np.arctan2, np.power)
# a machine is these ufuncs' (address of the loop, address of its data), then whether products are fused
_SIN, _COS, _TAN, _ARCSIN, _ARCTAN, _ARCTAN2, _POWER = range(0, 14, 2)
_DOT_FUSED = 14
_TURN_FUSED = 15
_EXACT = 16


@arithmetic
def sin(machine: Machine, x: float) -> float:
    """`np.sin`."""
    return float(call1(machine[_SIN], machine[_SIN + 1], x)) if machine[_SIN] else math.sin(x)


@arithmetic
def cos(machine: Machine, x: float) -> float:
    """`np.cos`."""
    return float(call1(machine[_COS], machine[_COS + 1], x)) if machine[_COS] else math.cos(x)


@arithmetic
def tan(machine: Machine, x: float) -> float:
    """`np.tan`."""
    return float(call1(machine[_TAN], machine[_TAN + 1], x)) if machine[_TAN] else math.tan(x)


@arithmetic
def arcsin(machine: Machine, x: float) -> float:
    """`np.arcsin`."""
    return float(call1(machine[_ARCSIN], machine[_ARCSIN + 1], x)) if machine[_ARCSIN] else math.asin(x)


@arithmetic
def arctan(machine: Machine, x: float) -> float:
    """`np.arctan`."""
    return float(call1(machine[_ARCTAN], machine[_ARCTAN + 1], x)) if machine[_ARCTAN] else math.atan(x)


@arithmetic
def arctan2(machine: Machine, y: float, x: float) -> float:
    """`np.arctan2`."""
    return float(call2(machine[_ARCTAN2], machine[_ARCTAN2 + 1], y, x)) if machine[_ARCTAN2] else math.atan2(y, x)


@arithmetic
def power(machine: Machine, x: float, exponent: float) -> float:
    """`np.power`, which squares by multiplying."""
    return float(call2(machine[_POWER], machine[_POWER + 1], x, exponent)) if machine[_POWER] else math.pow(x, exponent)


@arithmetic
def scalar_power(x: float, exponent: float) -> float:
    """`x ** exponent` of Python and of numpy's scalars: libm's `pow`, also for a square (hand in no constant)."""
    return math.pow(x, exponent)


@arithmetic
def dot2(machine: Machine, ax: float, ay: float, bx: float, by: float) -> float:
    """`np.dot` of two 2-vectors."""
    if machine[_DOT_FUSED]:
        return float(fma(ay, by, ax * bx))
    return ax * bx + ay * by


@arithmetic
def dot3(machine: Machine, ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    """`np.dot` of two 3-vectors."""
    if machine[_DOT_FUSED]:
        return float(fma(az, bz, fma(ay, by, ax * bx)))
    return ax * bx + ay * by + az * bz


@arithmetic
def turn2(machine: Machine, row_x: float, row_y: float, x: float, y: float) -> float:
    """One number of a matrix product `(2, 2) @ (2, 4)`: BLAS has another kernel for it than for `np.dot`."""
    if machine[_TURN_FUSED]:
        return float(fma(row_y, y, row_x * x))
    return row_x * x + row_y * y


def _evaluate_for(sources: int) -> Callable[[Machine, float, float], tuple[float, ...]]:
    @kernel
    def evaluate(machine: Machine, x: float, y: float) -> tuple[float, float, float, float, float, float, float]:
        _ = sources  # part of the cache's key
        share = x / (1.0 + abs(x))
        return (
            sin(machine, x), cos(machine, x), tan(machine, x), arcsin(machine, share),
            arctan(machine, x), arctan2(machine, y, x), power(machine, abs(x), y),
        )  # fmt: skip

    return evaluate


_evaluate = _evaluate_for(sources_digest())


def _numpys(x: float, y: float) -> tuple[float, ...]:
    share = x / (1.0 + abs(x))
    return (
        np.sin(x), np.cos(x), np.tan(x), np.arcsin(share), np.arctan(x), np.arctan2(y, x), np.power(abs(x), y),
    )  # fmt: skip


def _samples() -> list[list[float]]:
    """64 rows of six numbers with full mantissas, the same everywhere."""
    return [[(-1) ** column * math.sqrt(6 * row + column + 2) for column in range(6)] for row in range(64)]


def _dots_agree(numbers: Machine, row: list[float]) -> bool:
    a, b, c, d = row[:4]
    first, second = np.array([a, b]), np.array([c, d])
    return bool(
        dot2(numbers, a, b, c, d) == np.dot(first, second)
        and math.sqrt(dot2(numbers, a, b, a, b)) == np.linalg.norm(first)
        and dot3(numbers, *row[:3], *row[3:]) == np.dot(np.array(row[:3]), np.array(row[3:]))
    )


def _turns_agree(numbers: Machine, row: list[float]) -> bool:
    a, b, c, d, x, y = row
    turned = (np.array([[a, b], [c, d]]) @ np.tile([x, y], (4, 1)).T)[:, 0]  # as highway-env turns a body's corners
    return bool(turn2(numbers, a, b, x, y) == turned[0] and turn2(numbers, c, d, x, y) == turned[1])


def _measure(numbers: Machine, entry: int, agrees: Callable[[Machine, list[float]], bool]) -> bool:
    """Set whether numpy fuses in `entry`; False when neither way gives its results."""
    for fused in (1, 0):
        numbers[entry] = fused
        if all(agrees(numbers, row) for row in _samples()):
            return True
    return False


@cache
def _measured() -> Machine:
    numbers = np.zeros(17, dtype=np.int64)
    for k, ufunc in enumerate(_UFUNCS):
        numbers[2 * k : 2 * k + 2] = loop_of(ufunc)
    dots, turns = _measure(numbers, _DOT_FUSED, _dots_agree), _measure(numbers, _TURN_FUSED, _turns_agree)
    same = all(_evaluate(numbers, row[0], -row[1]) == _numpys(row[0], -row[1]) for row in _samples())
    numbers[_EXACT] = int(same and dots and turns)
    return numbers


def machine() -> Machine:
    """Addresses and rounding of this process's numpy, measured once: an int64 array that the kernels take."""
    return np.array(_measured())


def is_exact() -> bool:
    """Whether every function here gave numpy's very bits on the samples."""
    return bool(_measured()[_EXACT])
