"""How the world's kernels are compiled: inner ones into the entry points, the entry points into numba's cache.

numba's cache looks only at the file of the function that it stores, not at the functions and constants that were
compiled into it. So only entry points are cached, and each of them closes over a digest of every source that it may
contain: a change anywhere among them compiles anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numba

from pytest_drive_robust.domain import truth

__all__ = ["entry", "inner", "sources_digest"]

Function = TypeVar("Function", bound=Callable[..., object])

inner = numba.njit(error_model="numpy")
"""For functions that are only called by other compiled functions."""

entry = numba.njit(cache=True, error_model="numpy")
"""For functions that Python calls; they must close over `sources_digest()`."""


def sources_digest() -> int:
    """A number that changes with any file whose code or constants end up in a kernel; below 2**62."""
    kernels = Path(__file__).parent
    files = [*kernels.glob("*.py"), *(kernels.parent / name for name in ("criteria.py", "events.py", "state.py"))]
    digest = hashlib.blake2b(digest_size=8)
    for file in (*sorted(files), Path(truth.__file__)):
        digest.update(file.read_bytes())
    return int.from_bytes(digest.digest(), "big") >> 2
