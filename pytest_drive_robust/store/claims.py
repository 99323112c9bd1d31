"""Who drives which episode: one lock per episode that vanishes with the process that holds it.

The locks are those of the operating system (see the package `filelock`), never lock *files*: the kernel frees the lock
of a killed process at once, and no clock takes part. Where there are none (a network share without a lock service),
everybody gets the claim: driving twice is waste, not harm, because an episode gives the same bits again and its file
appears whole. Taking a claim and giving it back costs 0.2 ms.
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
    """The right to drive one episode. `release` it, at the latest when its result was put; twice does no harm."""

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
    """Locks in the first of `folders` that can be written to and has locks. It is made when the first is asked for."""

    def __init__(self, *folders: Path) -> None:
        self._folders = folders
        self._held: dict[str, BaseFileLock] = {}  # a lock that nobody refers to is released

    def attempt(self, key: str) -> Claim | None:
        """Return the claim, or None when a living process (or other `Claims` of this one) holds it. Never waits."""
        from filelock import FileLock, Timeout  # 40 ms, which a run that drives nothing does not spend

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
        """Remove the file while it is still locked: who opened it before finds it without a name and tries again."""
        lock = self._held.pop(key)
        with contextlib.suppress(OSError):  # Windows keeps open files: then it stays, empty
            os.unlink(lock.lock_file)
        with contextlib.suppress(OSError):
            lock.release()
