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
"""Added to the number of a group: it is in the cache. There are fewer groups."""
_ASK_S, _PATIENCE_S = 5.0, 300.0
"""How often to ask whether another process still compiles, and for how long: it may have been stopped meanwhile."""
_YIELDING = 10
"""How much nicer than others processes are that compile while these drive."""


def compile_all(*, processes: int, tell: Tell = lambda done, total: None) -> int:
    """Compile what the entry points of all imported modules lack, and load everything; return how many were compiled.

    `tell(done, total)` hears how many functions of those to be compiled are finished. Without `processes` (fewer than
    two, or where a process with several threads cannot be forked) everything is compiled here. Another process that
    does the same is waited for first, some minutes at most: it leaves in the cache what we would compile.
    """
    return Compilation(ENTRIES, processes=processes, tell=tell).missing


class Compilation:
    """Compiles what the entry points of all imported modules lack: those of `first` before anything else happens.

    When it is made they are compiled and loaded. The others are compiled meanwhile and afterwards, in at least one
    process, which yields to those that drive: `news` becomes readable when there is something to `hear`. `missing` is
    how many entry points were not in the cache, `children` those processes. See `compile_all` for the rest.
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
        aside = processes > 1 or later  # one process lets others drive, too
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
        """Take in how far the processes have come; load everything when nothing is left, and `news` is None then."""
        self._read()
        if self.news is None:
            self._end()

    def _wait_for_others(self, awaited: Sequence[Any]) -> None:
        """Wait until no other process compiles for the same cache; where nothing can be written, do not wait.

        Say so once, and go on without the lock after some minutes: two that compile the same write the same.
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
        """Take a lock, until all is compiled; return False when another process has it for `_ASK_S`."""
        try:
            self._held.enter_context(lock.acquire(timeout=_ASK_S))
        except filelock.Timeout:
            return False
        return True

    def _fork(self, groups: list[list[Any]], processes: int) -> None:
        """Let forked processes take one group after the other; each says when it finished a function, and all of them.

        What a process could not compile is compiled, and its error raised, by the one that needs it.
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
        """Wait for the next news of the processes; `news` is None when they have ended."""
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
            with suppress(ChildProcessError):  # somebody else here waits for all children
                os.waitpid(child, 0)
        self._held.close()
        _compile(ENTRIES)


def _say(text: str) -> None:
    print(f"drive-robust: {text}", file=sys.stderr, flush=True)


def missing_functions() -> int:
    """Return how many functions the entry points of all imported modules lack."""
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
    """Return entry points that share inner functions together, so that each is compiled once; the largest first."""
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
