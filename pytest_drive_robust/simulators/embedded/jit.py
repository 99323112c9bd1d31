"""How kernels are compiled: inner ones into the entry points, the entry points into numba's cache.

numba's cache looks only at the file of the function that it stores, not at the functions and constants that were
compiled into it. So only entry points are cached, and each of them closes over a digest of every source that it may
contain: a change anywhere among them compiles anew. Nothing is compiled with fast mathematics or in parallel: the same
inputs give the same bits.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

import numba

__all__ = ["entry", "inner", "inner_only", "sources_digest"]

Function = TypeVar("Function", bound=Callable[..., Any])

entry = numba.njit(cache=True, error_model="numpy")
"""For functions that Python calls; they must close over a `sources_digest`."""


inner = numba.njit(error_model="numpy")
"""For functions that other compiled functions call, and Python now and then."""


def inner_only(function: Function) -> Function:
    """Compile what only other compiled functions call; wrappers for Python would cost a third of the time more.

    Called from Python, such a function ends the process.
    """
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, numba.njit(**options)(function))


def sources_digest(*modules: ModuleType) -> int:
    """Return a number below 2**62 that changes with any file of these modules; a package counts with its modules.

    Name all modules whose code or constants end up in a kernel.
    """
    digest = hashlib.blake2b(digest_size=8)
    for module in modules:
        file = Path(str(module.__file__))
        for source in sorted(file.parent.glob("*.py")) if file.name == "__init__.py" else [file]:
            digest.update(source.read_bytes())
    return int.from_bytes(digest.digest(), "big") >> 2
