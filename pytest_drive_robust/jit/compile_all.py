"""Compile every entry point that is not in the cache, side by side in processes that leave the machine code there."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from typing import Any

import filelock

from pytest_drive_robust.jit.cache import cache_folder
from pytest_drive_robust.jit.compiled_functions import CompiledFunctions, Tell, counted
from pytest_drive_robust.jit.entry_groups import compile_entries, count_functions, group_entries, missing_entries
from pytest_drive_robust.jit.kernels import ENTRIES

_WHOLE = 128
"""Added to a group's number in a report that the whole group is in the cache; we fork only for fewer groups."""
_LOCK_TRY_S, _LOCK_WAIT_S = 5.0, 300.0
"""Seconds between two tries to take the lock from another process, and in all: that process may have been stopped."""
_YIELDING = 10
"""Added to the nice value of the processes that compile while we drive."""


def compile_all(*, processes: int, tell: Tell = lambda done, total: None) -> int:
    """Compile the entry points of all imported modules that are not in the cache, and load all; return how many.

    `tell(done, total)` is called with the number of functions compiled so far and in all. This process compiles
    everything itself with fewer than two `processes`, or where it has several threads and cannot be forked. If another
    process compiles for the same cache, wait for it first, five minutes at most: its code will be in the cache.
    """
    return Compilation(ENTRIES, processes=processes, tell=tell).missing


class Compilation:
    """Compiles the entry points of all imported modules that are not in the cache, those in `first` before the others.

    The constructor returns when `first` is compiled and loaded. Forked processes, at least one, compile the others
    meanwhile and afterwards, with lower priority than processes that drive. `progress_fd` is a descriptor that becomes
    readable when there is something for `read_progress`, None when all is compiled. `missing` is the number of entry
    points that were not in the cache, `children` are the ids of the forked processes. See `compile_all` for the other
    arguments.
    """

    def __init__(self, first: Sequence[Any], *, processes: int, tell: Tell = lambda done, total: None) -> None:
        self.progress_fd: int | None = None
        self._tell = tell
        self.children: list[int] = []
        self._locks = ExitStack()
        missing = missing_entries(ENTRIES)
        if missing:
            self._wait_for_others([one for one in missing if one in first] or missing)
            missing = missing_entries(ENTRIES)
        self.missing = len(missing)
        early = group_entries([one for one in missing if one in first])
        others = group_entries([one for one in missing if one not in first])
        groups = [*early, *others]
        self._counts = [count_functions(group) for group in groups]
        self._compiled = [0] * len(groups)
        self._whole: set[int] = set()
        self._awaited = range(len(early))  # numbers of the groups that we wait for, whose progress is told
        aside = processes > 1 or others  # even a single process, so that we can drive while it compiles the others
        if aside and 1 < len(groups) < _WHOLE and _may_fork() and os.access(cache_folder(), os.W_OK):
            self._fork(groups, max(1, processes))
            while self.progress_fd is not None and not (others and self._whole.issuperset(self._awaited)):
                self._read_reports()
        elif missing:
            with counted(tell, count_functions(missing)):
                compile_entries(missing)
        compile_entries(first)  # from the cache
        if self.progress_fd is None:
            self._end()
            return
        self._awaited = range(len(early), len(groups))
        for child in self.children:
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, child, os.getpriority(os.PRIO_PROCESS, 0) + _YIELDING)

    def read_progress(self) -> None:
        """Read the progress of the forked processes; when all have ended, load everything, `progress_fd` is None."""
        self._read_reports()
        if self.progress_fd is None:
            self._end()

    def _wait_for_others(self, awaited: Sequence[Any]) -> None:
        """Wait until no other process compiles for the same cache; do not wait where nothing can be written.

        Print once that we wait. Go on without the lock after `_LOCK_WAIT_S` seconds: two processes that compile the
        same function write the same file.
        """
        with suppress(OSError):
            cache_folder().mkdir(parents=True, exist_ok=True)
            lock, until_s = filelock.FileLock(cache_folder() / "compiling.lock"), time.monotonic() + _LOCK_WAIT_S
            printed = False
            while not self._take_lock(lock):
                if not printed:
                    _print(f"another process compiles for the cache {cache_folder()}, waiting for what it leaves")
                    self._tell(0, count_functions(awaited))
                printed = True
                if time.monotonic() >= until_s:
                    _print(f"another process has held {lock.lock_file} for {_LOCK_WAIT_S:.0f} s, compiling without it")
                    return

    def _take_lock(self, lock: filelock.BaseFileLock) -> bool:
        """Take the lock and hold it until all is compiled; return False if another process holds it."""
        try:
            self._locks.enter_context(lock.acquire(timeout=_LOCK_TRY_S))
        except filelock.Timeout:
            return False
        return True

    def _fork(self, groups: list[list[Any]], processes: int) -> None:
        """Fork processes that compile one group after the other and report each finished function and group.

        A function that a forked process could not compile is compiled by the process that needs it, where the error is
        raised.
        """
        self.progress_fd, write = os.pipe()
        waiting, queue = os.pipe()
        os.write(queue, bytes(range(len(groups))))
        os.close(queue)
        for _ in range(min(processes, len(groups))):
            self.children.append(_fork_compiler(groups, waiting, write, self.progress_fd))
        os.close(write)
        os.close(waiting)
        self._tell_awaited()

    def _read_reports(self) -> None:
        """Wait for reports of the forked processes and count them; when all have ended, set `progress_fd` to None."""
        assert self.progress_fd is not None
        data = os.read(self.progress_fd, 1024)
        for report in data:
            number = report % _WHOLE
            if report == number:
                self._compiled[number] = min(self._compiled[number] + 1, self._counts[number])
            else:
                self._compiled[number] = self._counts[number]
                self._whole.add(number)
        if not data:
            os.close(self.progress_fd)
            self.progress_fd = None
            self._compiled = list(self._counts)
        self._tell_awaited()

    def _tell_awaited(self) -> None:
        self._tell(*(sum(counts[number] for number in self._awaited) for counts in (self._compiled, self._counts)))

    def _end(self) -> None:
        for child in self.children:
            with suppress(ChildProcessError):  # other code in this process has waited for all children
                os.waitpid(child, 0)
        self._locks.close()
        compile_entries(ENTRIES)


def _print(text: str) -> None:
    print(f"drive-robust: {text}", file=sys.stderr, flush=True)


def missing_functions() -> int:
    """Return how many functions must be compiled for the entry points of all imported modules."""
    return count_functions(missing_entries(ENTRIES))


def _may_fork() -> bool:
    return sys.platform == "linux" and len(os.listdir("/proc/self/task")) == 1


def _fork_compiler(groups: list[list[Any]], waiting: int, write: int, read: int) -> int:
    pid = os.fork()
    if pid:
        return pid
    try:
        os.close(read)
        CompiledFunctions(lambda: os.write(write, bytes([number]))).watch()
        while taken := os.read(waiting, 1):
            number = taken[0]
            compile_entries(groups[number])
            os.write(write, bytes([number + _WHOLE]))
    finally:
        os._exit(0)
