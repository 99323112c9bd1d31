"""The decorators of kernels. They do not import numba: it is loaded when a kernel is first called.

A run that drives nothing, because every episode is in the store, imports agents for their names and contents only.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

from pytest_drive_robust.errors import UsageError

Function = TypeVar("Function", bound=Callable[..., Any])

NOT_COMPILED = (
    "NUMBA_DISABLE_JIT is set, but the world needs compiled kernels: unset it, for this command at least "
    "(`env -u NUMBA_DISABLE_JIT pytest ...`). Coverage does not see into kernels either way."
)


def require_compiling() -> None:
    """Raise `UsageError` if the environment sets `NUMBA_DISABLE_JIT`. Does not load numba."""
    if os.environ.get("NUMBA_DISABLE_JIT", "").strip() not in ("", "0"):
        raise UsageError(NOT_COMPILED)


class Kernel:
    """A function for numba; `kind` names its maker in `dispatchers`: `cached_entry`, `uncached_entry` or `inner`.

    Python calls entries, only compiled functions call inner functions. A kernel has the attributes of numba's
    dispatcher. numba finds the inner functions of a kernel because it asks unknown objects for `_numba_type_`.
    """

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._kind = kind

    @functools.cached_property
    def dispatcher(self) -> Any:
        """numba's dispatcher of the function; making the dispatcher compiles nothing."""
        from pytest_drive_robust.jit import dispatchers  # loads numba

        return getattr(dispatchers, self._kind)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        """Run the function; the first call with arguments of these types compiles or loads its machine code."""
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # copying and pickling ask for what is not there
            raise AttributeError(name)
        return getattr(self.dispatcher, name)


ENTRIES: list[Kernel] = []
"""The entry points of all modules that were imported so far."""


def entry(function: Function) -> Function:
    """Compile a function that Python calls, at its first call, for the types of its annotations, and cache the code.

    See `signatures.argument_types` for what may be annotated.
    """
    kernel = Kernel(function, "cached_entry")
    ENTRIES.append(kernel)
    return cast(Function, kernel)


def uncached_entry(function: Function) -> Function:
    """Compile a function that Python calls, at its first call, for the types of its arguments; cache nothing."""
    return cast(Function, Kernel(function, "uncached_entry"))


def inner(function: Function) -> Function:
    """Compile a function that only compiled functions call; a call from Python raises `TypeError`."""
    return cast(Function, Kernel(function, "inner"))
