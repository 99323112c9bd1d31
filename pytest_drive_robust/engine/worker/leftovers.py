"""What an episode leaves in its process that cannot be put back: then the process is replaced."""

from __future__ import annotations

import _thread
import os
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

__all__ = ["Leftovers", "resident_bytes"]

_MOST_FILES = 100
_TASKS = "/proc/self/task"


class Leftovers:
    """Compares the process with what it was when this was made. `descriptors` are ours and must stay what they are."""

    def __init__(self, descriptors: Sequence[int]) -> None:
        self._threads = _thread._count()
        self._descriptors = {number: _identity(number) for number in descriptors}
        self._files = _open_files()

    def found(self) -> tuple[str, ...]:
        """Return what is not as it was, in words; empty when the next episode may be driven here."""
        problems = []
        threads = max(_thread._count() - self._threads, threading.active_count() - 1 - self._threads)
        if threads > 0:
            problems.append(f"{threads} threads that still run")
        children = _children()
        if children:
            problems.append(f"{children} child processes")
        if any(_identity(number) != known for number, known in self._descriptors.items()):
            problems.append("descriptors that were closed")
        if _open_files() - self._files > _MOST_FILES:
            problems.append(f"more than {_MOST_FILES} open files")
        return tuple(problems)


def resident_bytes() -> int:
    """Return the memory that this process occupies."""
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _identity(number: int) -> tuple[int, int] | None:
    try:
        status = os.fstat(number)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _children() -> int:
    """Count child processes, with those of children that ended: a worker is a subreaper."""
    try:
        return sum(map(_children_of, os.listdir(_TASKS)))
    except OSError:
        return 0


def _children_of(thread: str) -> int:
    fd = os.open(f"{_TASKS}/{thread}/children", os.O_RDONLY)
    try:
        return len(os.read(fd, 1 << 16).split())
    finally:
        os.close(fd)


def _open_files() -> int:
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return 0
