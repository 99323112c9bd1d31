"""Arithmetic that rounds as numpy does on this machine.

highway-env computes with numpy scalars and two-vectors, and numpy chooses its code by CPU: with AVX-512 its arctan2,
arcsin, arctan, tan and power are Intel's SVML (last bit unlike libm's), and a dot product goes through BLAS, which may
or may not fuse multiply and add. So we call numpy's own inner loops by their address, and measure how `np.dot` rounds.
The layout of `PyUFuncObject` is part of numpy's C API:
https://numpy.org/doc/stable/reference/c-api/types-and-structures.html#c.PyUFuncObject
"""

from __future__ import annotations

import ctypes
import math
from functools import cache
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray

__all__ = ["arcsin", "arctan", "arctan2", "cos", "dot2", "dot3", "is_exact", "machine", "power", "scalar_power", "sin", "tan"]

Machine = NDArray[np.int64]
_jit = numba.njit(cache=True)
_jit_inline = numba.njit(cache=True, forceinline=True)
_UFUNCS = (np.sin, np.cos, np.tan, np.arcsin, np.arctan, np.arctan2, np.power)
# a machine is these ufuncs' (address of the loop, address of its data), then how dot products round
_SIN, _COS, _TAN, _ARCSIN, _ARCTAN, _ARCTAN2, _POWER = range(0, 14, 2)
_DOT = 14
_EXACT = 15
_PLAIN, _FUSED_UP, _FUSED_DOWN = range(3)
_DOUBLE = 12  # NPY_DOUBLE


class _UFunc(ctypes.Structure):
    """The beginning of numpy's `PyUFuncObject`."""

    _fields_ = (
        ("head", ctypes.c_char * object.__basicsize__),
        ("nin", ctypes.c_int),
        ("nout", ctypes.c_int),
        ("nargs", ctypes.c_int),
        ("identity", ctypes.c_int),
        ("functions", ctypes.POINTER(ctypes.c_void_p)),
        ("data", ctypes.POINTER(ctypes.c_void_p)),
        ("ntypes", ctypes.c_int),
        ("reserved", ctypes.c_int),
        ("name", ctypes.c_char_p),
        ("types", ctypes.c_void_p),
    )


def _loop_of(ufunc: np.ufunc) -> tuple[int, int]:
    """(address of the float64 loop, address of its data), or (0, 0) when the memory is not what we expect."""
    seen = _UFunc.from_address(id(ufunc))
    if (seen.nin, seen.nout, seen.nargs, seen.ntypes) != (ufunc.nin, ufunc.nout, ufunc.nargs, ufunc.ntypes):
        return 0, 0
    signatures = ctypes.string_at(seen.types, seen.ntypes * seen.nargs)
    wanted = bytes([_DOUBLE]) * seen.nargs
    for k in range(seen.ntypes):
        if signatures[k * seen.nargs : (k + 1) * seen.nargs] == wanted:
            return seen.functions[k] or 0, seen.data[k] or 0
    return 0, 0


def _emit_call(builder: Any, address: Any, data: Any, inputs: list[Any]) -> Any:
    """LLVM for `loop(args, &1, strides, data)` on scalars: how numpy itself calls the loop for one element."""
    integer, byte = ir.IntType(64), ir.IntType(8).as_pointer()
    count = len(inputs) + 1
    slots = [cgutils.alloca_once_value(builder, value) for value in inputs]
    slots.append(cgutils.alloca_once(builder, ir.DoubleType()))
    arguments = cgutils.alloca_once(builder, ir.ArrayType(byte, count))
    strides = cgutils.alloca_once(builder, ir.ArrayType(integer, count))
    one = cgutils.alloca_once_value(builder, ir.Constant(integer, 1))
    for k, slot in enumerate(slots):
        builder.store(builder.bitcast(slot, byte), cgutils.gep_inbounds(builder, arguments, 0, k))
        builder.store(ir.Constant(integer, 0), cgutils.gep_inbounds(builder, strides, 0, k))
    kind = ir.FunctionType(
        ir.VoidType(), [byte.as_pointer(), integer.as_pointer(), integer.as_pointer(), byte]
    ).as_pointer()
    first, steps = (cgutils.gep_inbounds(builder, array, 0, 0) for array in (arguments, strides))
    builder.call(builder.inttoptr(address, kind), [first, one, steps, builder.inttoptr(data, byte)])
    return builder.load(slots[-1])


@intrinsic
def _call1(typing_context: Any, address: Any, data: Any, x: Any) -> Any:
    """A loop of one float64, called by its address."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return _emit_call(builder, given[0], given[1], [given[2]])

    return types.float64(types.int64, types.int64, types.float64), generate


@intrinsic
def _call2(typing_context: Any, address: Any, data: Any, x: Any, y: Any) -> Any:
    """A loop of two float64, called by its address."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return _emit_call(builder, given[0], given[1], [given[2], given[3]])

    return types.float64(types.int64, types.int64, types.float64, types.float64), generate


@intrinsic
def _fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """`a * b + c` with one rounding."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.fma(*given)

    return types.float64(types.float64, types.float64, types.float64), generate


@_jit_inline
def sin(machine: Machine, x: float) -> float:
    """`np.sin`."""
    return _call1(machine[_SIN], machine[_SIN + 1], x) if machine[_SIN] else math.sin(x)


@_jit_inline
def cos(machine: Machine, x: float) -> float:
    """`np.cos`."""
    return _call1(machine[_COS], machine[_COS + 1], x) if machine[_COS] else math.cos(x)


@_jit_inline
def tan(machine: Machine, x: float) -> float:
    """`np.tan`."""
    return _call1(machine[_TAN], machine[_TAN + 1], x) if machine[_TAN] else math.tan(x)


@_jit_inline
def arcsin(machine: Machine, x: float) -> float:
    """`np.arcsin`."""
    return _call1(machine[_ARCSIN], machine[_ARCSIN + 1], x) if machine[_ARCSIN] else math.asin(x)


@_jit_inline
def arctan(machine: Machine, x: float) -> float:
    """`np.arctan`."""
    return _call1(machine[_ARCTAN], machine[_ARCTAN + 1], x) if machine[_ARCTAN] else math.atan(x)


@_jit_inline
def arctan2(machine: Machine, y: float, x: float) -> float:
    """`np.arctan2`."""
    return _call2(machine[_ARCTAN2], machine[_ARCTAN2 + 1], y, x) if machine[_ARCTAN2] else math.atan2(y, x)


@_jit_inline
def power(machine: Machine, x: float, exponent: float) -> float:
    """`np.power`, which squares by multiplying."""
    return _call2(machine[_POWER], machine[_POWER + 1], x, exponent) if machine[_POWER] else math.pow(x, exponent)


@_jit_inline
def scalar_power(x: float, exponent: float) -> float:
    """`x ** exponent` of Python and of numpy's scalars: libm's `pow`, also for a square (hand in no constant)."""
    return math.pow(x, exponent)


@_jit_inline
def dot2(machine: Machine, ax: float, ay: float, bx: float, by: float) -> float:
    """`np.dot` of two 2-vectors."""
    if machine[_DOT] == _FUSED_UP:
        return _fma(ay, by, ax * bx)
    if machine[_DOT] == _FUSED_DOWN:
        return _fma(ax, bx, ay * by)
    return ax * bx + ay * by


@_jit_inline
def dot3(machine: Machine, ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    """`np.dot` of two 3-vectors."""
    if machine[_DOT] == _FUSED_UP:
        return _fma(az, bz, _fma(ay, by, ax * bx))
    if machine[_DOT] == _FUSED_DOWN:
        return _fma(ax, bx, _fma(ay, by, az * bz))
    return ax * bx + ay * by + az * bz


@_jit
def _evaluate(machine: Machine, x: float, y: float) -> tuple[float, float, float, float, float, float, float]:
    share = x / (1.0 + abs(x))
    return (
        sin(machine, x), cos(machine, x), tan(machine, x), arcsin(machine, share),
        arctan(machine, x), arctan2(machine, y, x), power(machine, abs(x), y),
    )  # fmt: skip


def _numpys(x: np.float64, y: np.float64) -> tuple[float, ...]:
    share = x / (1.0 + abs(x))
    return (
        np.sin(x), np.cos(x), np.tan(x), np.arcsin(share), np.arctan(x), np.arctan2(y, x), np.power(abs(x), y),
    )  # fmt: skip


def _samples() -> NDArray[np.float64]:
    """(64, 6) numbers with full mantissas, the same everywhere."""
    return np.sqrt(np.arange(2.0, 64 * 6 + 2.0)).reshape(64, 6) * np.where(np.arange(6) % 2 == 0, 1.0, -1.0)


def _dot_mode(numbers: Machine) -> int | None:
    """How `np.dot`, `np.linalg.norm` and a small matrix product round here; None when in no way that we know."""
    for mode in (_FUSED_UP, _PLAIN, _FUSED_DOWN):
        numbers[_DOT] = mode
        if all(_dots_agree(numbers, row) for row in _samples()):
            return mode
    return None


def _dots_agree(numbers: Machine, row: NDArray[np.float64]) -> bool:
    a, b, u, v = row[:2].copy(), row[2:4].copy(), row[:3].copy(), row[3:].copy()
    turned = (np.stack((a, b)) @ np.tile(row[4:], (4, 1)).T)[:, 0]  # as highway-env turns the corners of a body
    return (
        dot2(numbers, *a, *b) == np.dot(a, b)
        and math.sqrt(dot2(numbers, *a, *a)) == np.linalg.norm(a)
        and dot3(numbers, *u, *v) == np.dot(u, v)
        and dot2(numbers, *a, row[4], row[5]) == turned[0]
        and dot2(numbers, *b, row[4], row[5]) == turned[1]
    )


@cache
def _measured() -> Machine:
    numbers = np.zeros(16, dtype=np.int64)
    for k, ufunc in enumerate(_UFUNCS):
        numbers[2 * k : 2 * k + 2] = _loop_of(ufunc)
    mode = _dot_mode(numbers)
    numbers[_DOT] = _PLAIN if mode is None else mode
    same = all(_evaluate(numbers, row[0], -row[1]) == _numpys(row[0], -row[1]) for row in _samples())
    numbers[_EXACT] = int(same and mode is not None)
    return numbers


def machine() -> Machine:
    """Addresses and rounding of this process's numpy, measured once: an int64 array that the kernels take."""
    return _measured().copy()


def is_exact() -> bool:
    """Whether every function here gave numpy's very bits on the samples."""
    return bool(_measured()[_EXACT])
