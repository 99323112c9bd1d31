"""Calls of the operating system without a function in Python; each does nothing on a system that lacks the call."""

from __future__ import annotations

import _thread
import ctypes
import os
import resource
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_POLL_S = 0.5


def die_with_parent(parent: int) -> None:
    """End this process when its parent process `parent` ends; end at once when the parent already has."""
    if sys.platform == "linux":
        _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(0)
    else:
        _thread.start_new_thread(_leave_after, (parent,))  # a raw thread: no list of threads shows it


def outlive_starter() -> None:
    """Undo `die_with_parent` on Linux: there the parent is the thread that started us, which may end early."""
    _prctl(_PR_SET_PDEATHSIG, 0)


def adopt_orphans() -> None:
    """Make this process the parent of every descendant whose own parent ends. Linux only."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def child_processes() -> list[int]:
    """Return the process ids of the children of all threads. Linux only; empty on other systems."""
    with suppress(OSError):
        lists = [path.read_text() for path in Path("/proc/self/task").glob("*/children")]
        return [int(pid) for pids in lists for pid in pids.split()]
    return []


def resident_bytes() -> int:
    """Return the memory that this process occupies, in bytes: now on Linux, at its largest on other systems."""
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def descriptor_identity(number: int) -> tuple[int, int] | None:
    """Return the identity of the file behind a descriptor (device, inode); None for a closed descriptor."""
    try:
        status = os.fstat(number)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def limit_memory(size_bytes: int | None) -> None:
    """Limit the memory that this process may allocate to `size_bytes`; None sets no limit. Linux only."""
    if size_bytes is None or sys.platform != "linux":
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    size = size_bytes if hard == resource.RLIM_INFINITY else min(size_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def no_core_files() -> None:
    """Let this process crash without leaving a file."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def _leave_after(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_POLL_S)
    os._exit(0)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(option, value, 0, 0, 0)
