"""numpy's own inner loops, called from compiled code by their address.

The layout of `PyUFuncObject` and the signature of a loop are part of numpy's C API:
https://numpy.org/doc/stable/reference/c-api/types-and-structures.html#c.PyUFuncObject
"""

from __future__ import annotations

import ctypes
from typing import Any

import numba.core.cgutils
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import types
from numba.extending import intrinsic

__all__ = ["call1", "call2", "fma", "loop_of"]

_cgutils: Any = numba.core.cgutils  # untyped
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


def loop_of(ufunc: np.ufunc) -> tuple[int, int]:
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
    slots = [_cgutils.alloca_once_value(builder, value) for value in inputs]
    slots.append(_cgutils.alloca_once(builder, ir.DoubleType()))
    arguments = _cgutils.alloca_once(builder, ir.ArrayType(byte, count))
    strides = _cgutils.alloca_once(builder, ir.ArrayType(integer, count))
    one = _cgutils.alloca_once_value(builder, ir.Constant(integer, 1))
    for k, slot in enumerate(slots):
        builder.store(builder.bitcast(slot, byte), _cgutils.gep_inbounds(builder, arguments, 0, k))
        builder.store(ir.Constant(integer, 0), _cgutils.gep_inbounds(builder, strides, 0, k))
    kind = ir.FunctionType(
        ir.VoidType(), [byte.as_pointer(), integer.as_pointer(), integer.as_pointer(), byte]
    ).as_pointer()
    first, steps = (_cgutils.gep_inbounds(builder, array, 0, 0) for array in (arguments, strides))
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


# called from compiled code, where the first argument of an intrinsic is not given
call1: Any = _call1
call2: Any = _call2
fma: Any = _fma
