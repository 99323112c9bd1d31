"""Compile every entry point that is not in the cache, side by side in processes that leave the machine code there."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from types import FunctionType, ModuleType
from typing import Any

import filelock
from numba.core import event

from pytest_drive_robust.jit.cache import cache_folder
from pytest_drive_robust.jit.kernels import ENTRIES, Kernel
from pytest_drive_robust.jit.signatures import argument_types

Tell = Callable[[int, int], None]
_WHOLE = 128
"""Added to a group's number in a report that the whole group is in the cache; we fork only for fewer groups."""
_ASK_S, _PATIENCE_S = 5.0, 300.0
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
    meanwhile and afterwards, with lower priority than processes that drive. `news` is a file descriptor that becomes
    readable when there is something to `hear`, None when all is compiled. `missing` is the number of entry points that
    were not in the cache, `children` are the ids of the forked processes. See `compile_all` for the other arguments.
    """

    def __init__(self, first: Sequence[Any], *, processes: int, tell: Tell = lambda done, total: None) -> None:
        self.news: int | None = None
        self._tell = tell
        self.children: list[int] = []
        self._held = ExitStack()
        missing = _missing()
        if missing:
            self._wait_for_others([one for one in missing if one in first] or missing)
            missing = _missing()
        self.missing = len(missing)
        early = [one for one in missing if one in first]
        groups = [*_groups(early), *_groups([one for one in missing if one not in first])]
        self._counts = [_count(group) for group in groups]
        self._compiled = [0] * len(groups)
        self._whole: set[int] = set()
        self._awaited = range(len(_groups(early)))
        later = self._awaited.stop < len(groups)
        aside = processes > 1 or later  # even a single one, so that we can drive while it compiles
        if aside and 1 < len(groups) < _WHOLE and _may_fork() and os.access(cache_folder(), os.W_OK):
            self._fork(groups, max(1, processes))
            while self.news is not None and not (later and self._whole.issuperset(self._awaited)):
                self._read()
        elif missing:
            with _counted(tell, _count(missing)):
                _compile(missing)
        _compile(first)  # from the cache
        if self.news is None:
            self._end()
            return
        self._awaited = range(self._awaited.stop, len(groups))
        for child in self.children:
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, child, os.getpriority(os.PRIO_PROCESS, 0) + _YIELDING)

    def hear(self) -> None:
        """Read the progress of the forked processes; when all have ended, load everything and set `news` to None."""
        self._read()
        if self.news is None:
            self._end()

    def _wait_for_others(self, awaited: Sequence[Any]) -> None:
        """Wait until no other process compiles for the same cache; do not wait where nothing can be written.

        Print once that we wait. Go on without the lock after `_PATIENCE_S` seconds: two processes that compile the same
        function write the same file.
        """
        with suppress(OSError):
            cache_folder().mkdir(parents=True, exist_ok=True)
            lock, until_s = filelock.FileLock(cache_folder() / "compiling.lock"), time.monotonic() + _PATIENCE_S
            said = False
            while not self._takes(lock):
                if not said:
                    _say(f"another process compiles for the cache {cache_folder()}, waiting for what it leaves")
                    self._tell(0, _count(awaited))
                said = True
                if time.monotonic() >= until_s:
                    _say(f"another process has held {lock.lock_file} for {_PATIENCE_S:.0f} s, compiling without it")
                    return

    def _takes(self, lock: filelock.BaseFileLock) -> bool:
        """Take the lock and hold it until all is compiled; return False if another process keeps it for `_ASK_S`."""
        try:
            self._held.enter_context(lock.acquire(timeout=_ASK_S))
        except filelock.Timeout:
            return False
        return True

    def _fork(self, groups: list[list[Any]], processes: int) -> None:
        """Fork processes that compile one group after the other and report each finished function and group.

        A function that a forked process could not compile is compiled by the process that needs it, where the error is
        raised.
        """
        self.news, write = os.pipe()
        waiting, queue = os.pipe()
        os.write(queue, bytes(range(len(groups))))
        os.close(queue)
        for _ in range(min(processes, len(groups))):
            self.children.append(_fork_compiler(groups, waiting, write, self.news))
        os.close(write)
        os.close(waiting)
        self._tell_awaited()

    def _read(self) -> None:
        """Wait for the next reports of the forked processes and count them; set `news` to None when all have ended."""
        assert self.news is not None
        data = os.read(self.news, 1024)
        for said in data:
            number = said % _WHOLE
            if said == number:
                self._compiled[number] = min(self._compiled[number] + 1, self._counts[number])
            else:
                self._compiled[number] = self._counts[number]
                self._whole.add(number)
        if not data:
            os.close(self.news)
            self.news = None
            self._compiled = list(self._counts)
        self._tell_awaited()

    def _tell_awaited(self) -> None:
        self._tell(*(sum(counts[number] for number in self._awaited) for counts in (self._compiled, self._counts)))

    def _end(self) -> None:
        for child in self.children:
            with suppress(ChildProcessError):  # other code in this process has waited for all children
                os.waitpid(child, 0)
        self._held.close()
        _compile(ENTRIES)


def _say(text: str) -> None:
    print(f"drive-robust: {text}", file=sys.stderr, flush=True)


def missing_functions() -> int:
    """Return how many functions must be compiled for the entry points of all imported modules."""
    return _count(_missing())


def _missing() -> list[Any]:
    return [one for one in ENTRIES if not one.overloads and not one._cache.holds(_types(one), one.targetctx)]


def _types(kernel: Any) -> tuple[Any, ...]:
    return argument_types(kernel.py_func)


def _compile(entries: Sequence[Any]) -> None:
    for kernel in entries:
        kernel.compile(_types(kernel))


def _may_fork() -> bool:
    return sys.platform == "linux" and len(os.listdir("/proc/self/task")) == 1


def _groups(entries: Sequence[Any]) -> list[list[Any]]:
    """Group entry points that share inner functions, so that each function is compiled once; largest group first."""
    groups: list[tuple[set[int], list[Any]]] = []
    for kernel in entries:
        reached, members = _reached(kernel), [kernel]
        for other in [one for one in groups if one[0] & reached]:
            groups.remove(other)
            reached, members = reached | other[0], other[1] + members
        groups.append((reached, members))
    return [members for _, members in sorted(groups, key=lambda one: -len(one[0]))]


def _count(entries: Sequence[Any]) -> int:
    return len(set().union(*(_reached(kernel) for kernel in entries)))


def _reached(kernel: Any) -> set[int]:
    """Return the functions that are compiled with an entry point, by their identity."""
    seen: dict[int, Any] = {}
    _visit(kernel, seen)
    return set(seen)


def _visit(kernel: Any, seen: dict[int, Any]) -> None:
    if id(kernel) in seen:
        return
    seen[id(kernel)] = kernel
    function: FunctionType = kernel.py_func
    names = function.__code__.co_names
    for name in names:
        value = function.__globals__.get(name)
        found = [getattr(value, one, None) for one in names] if isinstance(value, ModuleType) else [value]
        for one in found:
            if isinstance(one, Kernel):
                _visit(one, seen)


class _Counter(event.Listener):  # type: ignore[misc]
    """Calls `finished` once for each of our functions when it is compiled."""

    def __init__(self, finished: Callable[[], object]) -> None:
        self._finished = finished
        self._seen: set[int] = set()

    def on_start(self, event: Any) -> None:
        """Do nothing."""

    def on_end(self, event: Any) -> None:
        """Count a function that was compiled for the first time; those of numba itself are not counted."""
        kernel = event.data["dispatcher"]
        module = str(kernel.py_func.__module__)
        if id(kernel) not in self._seen and not module.startswith("numba.") and module != "None":
            self._seen.add(id(kernel))
            self._finished()


@contextmanager
def _counted(tell: Tell, total: int) -> Iterator[None]:
    done = 0

    def finished() -> None:
        nonlocal done
        done += 1
        tell(min(done, total), total)

    tell(0, total)
    listener = _Counter(finished)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)
    tell(total, total)


def _fork_compiler(groups: list[list[Any]], waiting: int, write: int, read: int) -> int:
    pid = os.fork()
    if pid:
        return pid
    try:
        os.close(read)
        counter = _Counter(lambda: os.write(write, bytes([number])))
        event.register("numba:compile", counter)
        while taken := os.read(waiting, 1):
            number = taken[0]
            _compile(groups[number])
            os.write(write, bytes([number + _WHOLE]))
    finally:
        os._exit(0)
