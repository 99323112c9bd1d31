"""Compile every entry point that is not in the cache, side by side in processes that leave the machine code there."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from types import FunctionType, ModuleType
from typing import Any

import filelock
from numba.core import event

from pytest_drive_robust.jit.cache import cache_folder
from pytest_drive_robust.jit.kernels import ENTRIES, Kernel
from pytest_drive_robust.jit.signatures import argument_types

__all__ = ["compile_all", "missing_functions"]

Tell = Callable[[int, int], None]


def compile_all(*, processes: int, tell: Tell = lambda done, total: None) -> int:
    """Compile what the entry points of all imported modules lack, and load everything; return how many were compiled.

    `tell(done, total)` hears how many functions of those to be compiled are finished. Without `processes` (fewer than
    two, or where a process with several threads cannot be forked) everything is compiled here. Another process that
    does the same is waited for first: it leaves in the cache what we would compile.
    """
    missing = _missing()
    if missing:
        with _only_one():
            missing = _missing()
            groups = _groups(missing)
            if processes > 1 and len(groups) > 1 and _may_fork():
                _compile_in_processes(groups, processes, tell)
            else:
                with _counted(tell, _count(missing)):
                    _compile(missing)
    _compile(ENTRIES)  # from the cache
    return len(missing)


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


@contextmanager
def _only_one() -> Iterator[None]:
    """Wait until no other process compiles for the same cache; where nothing can be written, do not wait."""
    with ExitStack() as stack:
        with suppress(OSError):
            cache_folder().mkdir(parents=True, exist_ok=True)
            stack.enter_context(filelock.FileLock(cache_folder() / "compiling.lock"))
        yield


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


def _compile_in_processes(groups: list[list[Any]], processes: int, tell: Tell) -> None:
    """Let forked processes take one group after the other; each reports a byte for each function that it finished.

    What a process could not compile is compiled, and its error raised, by the one that needs it.
    """
    read, write = os.pipe()
    waiting, queue = os.pipe()
    os.write(queue, bytes(range(len(groups))))
    os.close(queue)
    children = [_fork_compiler(groups, waiting, write, read) for _ in range(min(processes, len(groups)))]
    os.close(write)
    os.close(waiting)
    done, total = 0, sum(_count(group) for group in groups)
    tell(0, total)
    while data := os.read(read, 1024):
        done = min(done + len(data), total)
        tell(done, total)
    os.close(read)
    for child in children:
        os.waitpid(child, 0)
    tell(total, total)


def _fork_compiler(groups: list[list[Any]], waiting: int, write: int, read: int) -> int:
    pid = os.fork()
    if pid:
        return pid
    try:
        os.close(read)
        event.register("numba:compile", _Counter(lambda: os.write(write, b".")))
        while number := os.read(waiting, 1):
            _compile(groups[number[0]])
    finally:
        os._exit(0)
