"""The two decorators of kernels.

Nothing is compiled with fast mathematics or in parallel, and division by zero gives infinity: the same inputs give the
same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

import numba
from numba import types

from pytest_drive_robust.jit.cache import KernelCache
from pytest_drive_robust.jit.libraries import PartCompiler, WholeCompiler

__all__ = ["ENTRIES", "entry", "inner", "uncached_entry"]

Function = TypeVar("Function", bound=Callable[..., Any])

ENTRIES: list[Any] = []
"""The entry points of all modules that were imported so far."""


def entry(function: Function) -> Function:
    """Compile what Python calls, at its first call, for the types of its annotations, and keep it in the cache.

    See `signatures.argument_types` for what may be annotated.
    """
    kernel: Any = numba.njit(error_model="numpy", pipeline_class=WholeCompiler)(function)
    kernel._cache = KernelCache(function)
    ENTRIES.append(kernel)
    return cast(Function, kernel)


def uncached_entry(function: Function) -> Function:
    """Compile what Python calls as `entry` does, for whatever types it is called with, and keep it nowhere."""
    return cast(Function, numba.njit(error_model="numpy", pipeline_class=WholeCompiler)(function))


def inner(function: Function) -> Function:
    """Compile what only compiled functions call; from Python it raises `TypeError`."""
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    kernel: Any = numba.njit(pipeline_class=PartCompiler, **options)(function)
    template = kernel.get_call_template

    def without_literals(arguments: Sequence[Any], keywords: dict[str, Any]) -> Any:
        """Take a number that the caller has written out for any number: numba compiles anew for each of them."""
        plain = {name: types.unliteral(one) for name, one in keywords.items()}
        return template(tuple(types.unliteral(one) for one in arguments), plain)

    kernel.get_call_template = without_literals
    return cast(Function, kernel)
