"""How the kernels are compiled: without fastmath, so that no operation is reordered or fused.

Only a `kernel` can be called from Python; it is cached on disk with everything that it calls inside. That cache looks
at the kernel's own file alone, so each kernel closes over a digest of every source that it may contain: a change
anywhere among them compiles anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

__all__ = ["arithmetic", "inline_part", "kernel", "part", "sources_digest"]

Function = TypeVar("Function", bound=Callable[..., Any])
_njit: Any = partial(numba.njit, error_model="numpy")  # a division by zero is infinite, as for numpy's scalars
_NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def kernel(function: Function) -> Function:
    """Compile what Python calls; it must close over `sources_digest()`."""
    return cast(Function, _njit(cache=True)(function))


def part(function: Function) -> Function:
    """Compile what only kernels call; the wrappers for Python would double the time that it takes."""
    return cast(Function, _njit(**_NO_WRAPPERS)(function))


def inline_part(function: Function) -> Function:
    """Compile into the caller: for what runs once per pair of bodies, where handing over `Arrays` would cost more."""
    return cast(Function, _njit(**_NO_WRAPPERS, forceinline=True)(function))


def arithmetic(function: Function) -> Function:
    """Compile a few operations: into the caller, and for Python too."""
    return cast(Function, _njit(forceinline=True)(function))


def sources_digest() -> int:
    """A number that changes with any file whose code or constants end up in a kernel; below 2**62."""
    digest = hashlib.blake2b(digest_size=8)
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return int.from_bytes(digest.digest(), "big") >> 2
