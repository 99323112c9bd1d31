"""numba's dispatchers of kernels: a dispatcher compiles its function for the types of the arguments.

Nothing is compiled with fast mathematics or in parallel, and division by zero gives infinity: the same inputs give the
same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numba
from numba import types

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.jit.cache import KernelCache
from pytest_drive_robust.jit.kernels import NOT_COMPILED
from pytest_drive_robust.jit.libraries import PartCompiler, WholeCompiler


def cached_entry(function: Callable[..., Any]) -> Any:
    """Return the dispatcher of an entry point that is kept in the cache. Raises as `uncached_entry` does."""
    dispatcher = uncached_entry(function)
    dispatcher._cache = KernelCache(function)
    return dispatcher


def uncached_entry(function: Callable[..., Any]) -> Any:
    """Return the dispatcher of an entry point that is not cached. Raises `UsageError` if numba may not compile."""
    _refuse_to_interpret()
    return numba.njit(error_model="numpy", pipeline_class=WholeCompiler)(function)


def _refuse_to_interpret() -> None:
    """Raise `UsageError` if numba is told not to compile (`NUMBA_DISABLE_JIT`): kernels are not written for Python."""
    if numba.config.DISABLE_JIT:
        raise UsageError(NOT_COMPILED)


def inner(function: Callable[..., Any]) -> Any:
    """Return the dispatcher of an inner function. Raises `UsageError` if numba may not compile."""
    _refuse_to_interpret()
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher: Any = numba.njit(pipeline_class=PartCompiler, **options)(function)
    template = dispatcher.get_call_template

    def without_literals(arguments: Sequence[Any], keywords: dict[str, Any]) -> Any:
        """Treat a literal number in a call as any number of its type: numba would compile anew for each literal."""
        plain = {name: types.unliteral(one) for name, one in keywords.items()}
        return template(tuple(types.unliteral(one) for one in arguments), plain)

    dispatcher.get_call_template = without_literals
    return dispatcher
