"""Who drives which episode: one lock per episode that vanishes with the process that holds it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

__all__ = ["Claims"]


class Claims:
    """Locks in `folder`. Operating system locks, never lock *files*: a killed worker must not block the others."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @contextmanager
    def attempt(self, key: str) -> Iterator[bool]:
        """True inside the block when the claim is ours, False when somebody else holds it. Never waits."""
        lock = FileLock(self._folder / f"{key}.lock", timeout=0)
        try:
            lock.acquire()
        except Timeout:
            yield False
            return
        try:
            yield True
        finally:
            lock.release()
