"""Claims on episodes: one lock per episode, freed when the process that holds the lock ends.

The locks are locks of the operating system (see the package `filelock`), not lock *files* whose existence means locked:
the kernel frees the lock of a killed process at once, and no clock takes part. Where the file system has no locks (a
network share without a lock service), every process gets the claim. Driving an episode twice is then waste, not harm,
because the episode gives the same bits again and its file appears whole. Taking and releasing a claim costs 0.2 ms.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import BaseFileLock


class Claim:
    """The right to drive one episode. Call `release` after the result was put; a second call does nothing."""

    __slots__ = ("_free",)

    def __init__(self, free: Callable[[], object] | None = None) -> None:
        self._free = free

    def release(self) -> None:
        """Give the right to drive back."""
        free, self._free = self._free, None
        if free is not None:
            free()

    def __enter__(self) -> Claim:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()


class Claims:
    """Locks in the first of `folders` that is writable and has locks. The first claim creates that folder."""

    def __init__(self, *folders: Path) -> None:
        self._folders = folders
        self._held: dict[str, BaseFileLock] = {}  # a lock that nobody refers to is released

    def attempt(self, key: str) -> Claim | None:
        """Return the claim, or None when a living process or this object already holds the claim. Never waits."""
        from filelock import FileLock, Timeout  # imported late: 40 ms that a run which drives nothing saves

        if key in self._held:
            return None
        for folder in self._folders:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                lock = FileLock(folder / f"{key}.lock", timeout=0, thread_local=False, fallback_to_soft=False)
                lock.acquire()
            except Timeout:
                return None
            except OSError:  # no permission, or no lock service
                continue
            self._held[key] = lock
            return Claim(partial(self._release, key))
        return Claim()

    def _release(self, key: str) -> None:
        """Remove the lock file while it is locked: a process that opened the file before then tries again."""
        lock = self._held.pop(key)
        with contextlib.suppress(OSError):  # Windows cannot remove an open file: the empty file stays
            os.unlink(lock.lock_file)
        with contextlib.suppress(OSError):
            lock.release()
