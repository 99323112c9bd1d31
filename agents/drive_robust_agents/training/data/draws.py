"""Random numbers that depend only on the names of a draw, not on workers, order or process."""

from __future__ import annotations

import hashlib

import numpy as np

__all__ = ["draws"]


def draws(*names: object) -> np.random.Generator:
    """Return a generator named by (data seed, route, purpose, ...); equal names give equal numbers."""
    text = "\x1f".join(str(name) for name in names).encode()
    key = np.frombuffer(hashlib.blake2b(text, digest_size=16).digest(), dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key))
