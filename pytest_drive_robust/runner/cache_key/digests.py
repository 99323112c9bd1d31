"""Digests of bytes and of files."""

from __future__ import annotations

import hashlib
from pathlib import Path

_BLOCK_BYTES = 1 << 20


def add_file(digest: hashlib.blake2b, path: str | Path) -> None:
    """Add the content of a file, which may be larger than the memory. Raises `OSError`."""
    with open(path, "rb") as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)


def hex_of(content: bytes) -> str:
    """Return a digest of bytes, 12 hex digits."""
    return hashlib.blake2b(content, digest_size=6).hexdigest()
