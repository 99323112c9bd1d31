"""How the planner's kernels are compiled and kept in numba's cache.

numba's cache looks only at the file of the function that it stores, not at the functions and constants that were
compiled into it. So what is cached uses nothing of ours but its own file, or it closes over `sources_digest()`, and
then what it calls is `inner`: that is compiled into it and never kept by itself.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numba

__all__ = ["entry", "inner", "sources_digest"]

inner = numba.njit(cache=False)
"""For functions that are only called by other compiled functions."""

entry = numba.njit(cache=True)
"""For functions that Python calls."""


def sources_digest() -> int:
    """Return a number that changes with any file whose code or constants end up in a kernel; below 2**62."""
    digest = hashlib.blake2b(digest_size=8)
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return int.from_bytes(digest.digest(), "big") >> 2
