"""How the drawing kernels are compiled: inner ones into the entry points of `entry.py`, those into numba's cache.

numba's cache looks only at the file of the function that it stores, not at the functions and constants that were
compiled into it. So only entry points are cached, and each of them closes over a digest of every source that it may
contain: a change anywhere among them compiles anew. Nothing is compiled with fast mathematics or in parallel: the same
inputs give the same bits.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from pytest_drive_robust.domain import truth
from pytest_drive_robust.simulators.embedded import semantics

__all__ = ["entry", "inner", "sources_digest"]

Function = TypeVar("Function", bound=Callable[..., Any])

entry = numba.njit(cache=True, error_model="numpy")
"""For functions that Python calls; they must close over `sources_digest()`."""


def inner(function: Function) -> Function:
    """Compile what only other compiled functions call; wrappers for Python would cost a third of the time more."""
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, numba.njit(**options)(function))


def sources_digest() -> int:
    """A number that changes with any file whose code or constants end up in a kernel; below 2**62."""
    files = [*sorted(Path(__file__).parent.glob("*.py")), Path(truth.__file__), Path(semantics.__file__)]
    digest = hashlib.blake2b(digest_size=8)
    for file in files:
        digest.update(file.read_bytes())
    return int.from_bytes(digest.digest(), "big") >> 2
