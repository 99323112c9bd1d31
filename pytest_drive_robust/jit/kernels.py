"""The two decorators of kernels. They do not import numba: it is loaded when a kernel is first called.

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
    """Raise `UsageError` where the environment keeps numba from compiling; numba is not loaded for it."""
    if os.environ.get("NUMBA_DISABLE_JIT", "").strip() not in ("", "0"):
        raise UsageError(NOT_COMPILED)


class Kernel:
    """A function for numba: what Python calls (`entry`, with `cached` kept in the cache) or a part of that (`inner`).

    It has the attributes of numba's dispatcher. The parts of a kernel are found as such by numba, because it asks
    unknown objects for `_numba_type_`.
    """

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._kind = kind

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba made of the function, so far without compiling it."""
        from pytest_drive_robust.jit import dispatchers  # loads numba

        return getattr(dispatchers, self._kind)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        """Compile or load it for these arguments, unless that was done, and run it."""
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # copying and pickling ask for what is not there
            raise AttributeError(name)
        return getattr(self.dispatcher, name)


ENTRIES: list[Kernel] = []
"""The entry points of all modules that were imported so far."""


def entry(function: Function) -> Function:
    """Compile what Python calls, at its first call, for the types of its annotations, and keep it in the cache.

    See `signatures.argument_types` for what may be annotated.
    """
    kernel = Kernel(function, "cached_entry")
    ENTRIES.append(kernel)
    return cast(Function, kernel)


def uncached_entry(function: Function) -> Function:
    """Compile what Python calls as `entry` does, for whatever types it is called with, and keep it nowhere."""
    return cast(Function, Kernel(function, "uncached_entry"))


def inner(function: Function) -> Function:
    """Compile what only compiled functions call; from Python it raises `TypeError`."""
    return cast(Function, Kernel(function, "inner"))
