"""The machine code of elementary functions, for `compiled`.

Each function is compiled once, by itself, on first use. Kernels then call it by its symbol, like a function of the C
library.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import llvmlite.binding
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.ccallback import CFunc
from numba.core.registry import cpu_target
from numba.extending import intrinsic, register_jitable

from pytest_drive_robust.arithmetic import scalars, series
from pytest_drive_robust.arithmetic.compiled import INLINED, python_function
from pytest_drive_robust.jit.cache import KernelCache
from pytest_drive_robust.jit.resolutions import remembered_resolutions

_CPU: Any = cpu_target
_DOUBLE = ir.DoubleType()
_CGUTILS: Any = cgutils  # numba has no types for mypy
_TYPES: Any = types
_COMPILED: list[Any] = []  # machine code is freed with the object that holds it

for _module in (series, scalars):
    for _function in vars(_module).values():
        if getattr(_function, "__module__", None) == _module.__name__ and callable(_function):
            register_jitable(forceinline=True)(_function)


def numba_type(name: str) -> Any:
    """Return the numba type of the function `name` of `compiled`."""
    context = _CPU.typing_context
    if name in INLINED:
        function: Any = python_function(name)
    else:
        function = _of_pair() if name == "cos_sin" else _of_number(name, 2 if name == "atan2" else 1)
    context.refresh()
    return context.resolve_value_type(function)


def load(name: str) -> None:
    """Compile or load the machine code of the function `name` of `compiled`; kernels call this code by its symbol."""
    if name not in INLINED:
        _symbol(name)


def _of_number(name: str, takes: int) -> Any:
    """Return an intrinsic that calls the machine code of `name`, a function of `takes` floats that returns a float."""
    signature, symbol = types.float64(*[types.float64] * takes), _symbol(name)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        declared = ir.FunctionType(_DOUBLE, [_DOUBLE] * takes)
        return builder.call(_CGUTILS.insert_pure_function(builder.module, declared, symbol), arguments)

    if takes == 1:
        return intrinsic(lambda _, x: (signature, generate))
    return intrinsic(lambda _, x, y: (signature, generate))


def _of_pair() -> Any:
    """Return an intrinsic that calls the machine code of `cos_sin`, which writes two floats."""
    symbol, pair = _symbol("cos_sin"), _TYPES.UniTuple(types.float64, 2)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        declared = ir.FunctionType(ir.VoidType(), [_DOUBLE, _DOUBLE.as_pointer()])
        place = _CGUTILS.alloca_once(builder, _DOUBLE, size=2)
        builder.call(_CGUTILS.get_or_insert_function(builder.module, declared, symbol), [arguments[0], place])
        values = [builder.load(_CGUTILS.gep_inbounds(builder, place, k)) for k in (0, 1)]
        return context.make_tuple(builder, signature.return_type, values)

    return intrinsic(lambda _, x: (pair(types.float64), generate))


@functools.cache
def _symbol(name: str) -> str:
    """Compile or load a function, once, and return the symbol of its machine code."""
    function, double = getattr(scalars, name), _TYPES.float64
    body: Callable[..., Any]
    if name == "cos_sin":
        body, signature = _writing_two(function), _TYPES.void(double, _TYPES.CPointer(double))
    elif name == "atan2":
        body, signature = _taking_two(function), double(double, double)
    else:
        body, signature = _taking_one(function), double(double)
    compiled: Any = CFunc(
        body, (signature.args, signature.return_type), {}, {"error_model": "numpy", "forceinline": True}
    )
    compiled._cache = KernelCache(body)
    with remembered_resolutions():
        compiled.compile()
    symbol = f"pytest_drive_robust_{name}"
    llvmlite.binding.add_symbol(symbol, compiled.address)
    _COMPILED.append(compiled)
    return symbol


def _taking_one(function: Callable[[float], float]) -> Callable[[float], float]:
    def compiled(x: float) -> float:
        return function(x)

    return compiled


def _taking_two(function: Callable[[float, float], float]) -> Callable[[float, float], float]:
    def compiled(x: float, y: float) -> float:
        return function(x, y)

    return compiled


def _writing_two(function: Callable[[float], tuple[float, float]]) -> Callable[[float, Any], None]:
    def compiled(x: float, out: Any) -> None:
        out[0], out[1] = function(x)

    return compiled
