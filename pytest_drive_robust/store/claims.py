"""Who drives which episode: one lock per episode that vanishes with the process that holds it.

The locks are those of the operating system, never lock *files*: the kernel frees the lock of a killed process at once,
and no clock takes part. Where there are none (a network share without a lock service), everybody gets the claim:
driving twice is waste, not harm, because an episode gives the same bits again and its file appears whole.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

__all__ = ["Claim", "Claims"]

_BUSY = frozenset({errno.EAGAIN, errno.EACCES, errno.EWOULDBLOCK, errno.EDEADLK})
_ATTEMPTS = 100


class Claim:
    """The right to drive one episode. `release` it, at the latest when its result was put; twice does no harm."""

    __slots__ = ("_free",)

    def __init__(self, free: Callable[[], object] | None = None) -> None:
        self._free = free

    def release(self) -> None:
        """Give it back."""
        free, self._free = self._free, None
        if free is not None:
            free()

    def __enter__(self) -> Claim:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.release()


class Claims:
    """Locks in the first of `folders` that can be written to and has locks. It is made when the first is asked for."""

    def __init__(self, *folders: Path) -> None:
        self._folders = folders

    def attempt(self, key: str) -> Claim | None:
        """The claim, or None when a living process (or another thread of this one) holds it. Never waits."""
        for folder in self._folders:
            try:
                return self._attempt(folder, key)
            except OSError:  # noqa: PERF203 - no permission, or no lock service
                continue
        return Claim()

    def _attempt(self, folder: Path, key: str) -> Claim | None:
        path = folder / f"{key}.lock"
        for _ in range(_ATTEMPTS):
            descriptor = self._open(path)
            try:
                locked = _lock(descriptor)
            except OSError:
                os.close(descriptor)
                raise
            if not locked:
                os.close(descriptor)
                return None
            if _is_at(descriptor, path):
                return Claim(functools.partial(_free, descriptor, path))
            os.close(descriptor)  # its holder removed the file between our open and our lock
        return None

    @staticmethod
    def _open(path: Path) -> int:
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOINHERIT", 0)
        try:
            return os.open(path, flags, 0o666)
        except FileNotFoundError:
            path.parent.mkdir(parents=True, exist_ok=True)
            return os.open(path, flags, 0o666)


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def _free(descriptor: int, path: Path) -> None:
    """Remove the file while it is still locked, so that nobody can be holding the one that we remove."""
    with contextlib.suppress(OSError):  # Windows keeps open files: then it stays, empty
        os.unlink(path)
    with contextlib.suppress(OSError):
        os.close(descriptor)


if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int) -> bool:
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            if error.errno in _BUSY:
                return False
            raise
        return True
else:
    import fcntl

    def _lock(descriptor: int) -> bool:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in _BUSY:
                return False
            raise
        return True
