"""What an agent may change of its process besides its own memory: put back after each episode.

An episode must not depend on which ones its process drove before.
"""

from __future__ import annotations

import _thread
import builtins
import gc
import locale
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from typing import Any, NamedTuple

from pytest_drive_robust.engine.worker.system import child_processes, resident_bytes

__all__ = ["Leftovers", "read_process_state", "restore_process_state"]

_MOST_FILES = 100
_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "displayhook", "breakpointhook", "unraisablehook")
_SIGNALS = sorted(signal.valid_signals() - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")})
_TIMERS = (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)


class _Item(NamedTuple):
    """One thing to look after. `module`: only when that one is loaded."""

    read: Callable[[], Any]
    write: Callable[[Any], object]
    module: str = "builtins"


def read_process_state() -> Mapping[int, Any]:
    """Return how things are now; `restore_process_state` makes them so again."""
    return {number: item.read() for number, item in enumerate(_ITEMS) if item.module in sys.modules}


def restore_process_state(wanted: Mapping[int, Any]) -> bool:
    """Make things as they were; return whether all of them are."""
    return all([_restore(_ITEMS[number], value) for number, value in wanted.items()])  # noqa: C419 - each of them


def _restore(item: _Item, value: Any) -> bool:
    try:
        if item.read() == value:
            return True
        item.write(value)
        return bool(item.read() == value)
    except Exception:  # the folder is gone, a handler cannot be installed, ...: another process can
        return False


class Leftovers:
    """What an episode leaves that cannot be put back: then the process is replaced.

    `descriptors` are ours and must stay what they are. The process may grow by `growth_bytes` after its first episode.
    """

    def __init__(self, descriptors: Sequence[int], *, growth_bytes: int) -> None:
        self._threads = _thread._count()
        self._descriptors = {number: _identity(number) for number in descriptors}
        self._files = _open_files()
        self._growth_bytes = growth_bytes
        self._first_bytes = 0

    def found(self) -> bool:
        """Return whether there are any after an episode."""
        size_bytes = resident_bytes()
        self._first_bytes = self._first_bytes or size_bytes
        return (
            max(_thread._count(), threading.active_count() - 1) > self._threads
            or bool(child_processes())  # with those of children that ended: a worker is a subreaper
            or any(_identity(number) != known for number, known in self._descriptors.items())
            or _open_files() - self._files > _MOST_FILES
            or size_bytes - self._first_bytes > self._growth_bytes
        )


def _identity(number: int) -> tuple[int, int] | None:
    try:
        status = os.fstat(number)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _open_files() -> int:
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return 0


def _attributes(owner: Any, *attributes: str) -> _Item:
    """Look after attributes of a module."""

    def write(wanted: tuple[Any, ...]) -> None:
        for attribute, value in zip(attributes, wanted, strict=True):
            setattr(owner, attribute, value)

    return _Item(lambda: tuple(getattr(owner, attribute) for attribute in attributes), write)


def _settings(module: str, *pairs: tuple[str, str]) -> _Item:
    """Look after what pairs of functions of a module read and write; a dictionary is written as keywords."""

    def read() -> tuple[Any, ...]:
        found = (getattr(sys.modules[module], getter)() for getter, _ in pairs)
        return tuple(dict(value) if isinstance(value, dict) else value for value in found)

    def write(wanted: tuple[Any, ...]) -> None:
        for (_, setter), value in zip(pairs, wanted, strict=True):
            function = getattr(sys.modules[module], setter)
            function(**value) if isinstance(value, dict) else function(value)

    return _Item(read, write, module)


def _list(owner: Any, attribute: str) -> _Item:
    """Look after the elements of a list that stays the same object."""

    def write(wanted: list[Any]) -> None:
        getattr(owner, attribute)[:] = wanted

    return _Item(lambda: list(getattr(owner, attribute)), write)


def _mapping(owner: MutableMapping[str, Any]) -> _Item:
    """Look after the content of a mapping that stays the same object."""

    def write(wanted: dict[str, Any]) -> None:
        for key in set(owner) - set(wanted):
            del owner[key]
        owner.update(wanted)

    return _Item(lambda: dict(owner), write)


def _handlers() -> dict[int, Any]:
    return {number: signal.getsignal(number) for number in _SIGNALS}


def _set_handlers(wanted: dict[int, Any]) -> None:
    for number, handler in wanted.items():
        if handler is not None and signal.getsignal(number) != handler:
            signal.signal(number, handler)


def _has_timer() -> bool:
    return any(signal.getitimer(which)[0] > 0 for which in _TIMERS)


def _stop_timers(_: bool) -> None:
    for which in _TIMERS:
        signal.setitimer(which, 0)


def _logging() -> tuple[Any, ...]:
    root = logging.root
    return (root.level, tuple(root.handlers), tuple(root.filters), root.disabled, root.manager.disable)


def _set_logging(wanted: tuple[Any, ...]) -> None:
    root = logging.root
    level, handlers, filters, root.disabled, root.manager.disable = wanted
    root.setLevel(level)
    root.handlers[:], root.filters[:] = handlers, filters


def _umask() -> int:
    now = os.umask(0o077)
    os.umask(now)
    return now


def _set_collector(wanted: tuple[bool, tuple[int, int, int]]) -> None:
    (gc.enable if wanted[0] else gc.disable)()
    gc.set_threshold(*wanted[1])


def _priority() -> tuple[int, frozenset[int]]:
    affinity: Any = getattr(os, "sched_getaffinity", lambda _: ())
    return os.getpriority(os.PRIO_PROCESS, 0), frozenset(affinity(0))


def _set_priority(wanted: tuple[int, frozenset[int]]) -> None:
    os.setpriority(os.PRIO_PROCESS, 0, wanted[0])
    if wanted[1]:
        os.sched_setaffinity(0, wanted[1])


_ITEMS = (
    _Item(os.getcwd, os.chdir),
    _mapping(os.environ),
    _list(sys, "path"),
    _list(warnings, "filters"),
    _attributes(warnings, "showwarning"),
    _Item(_has_timer, _stop_timers),
    _Item(_handlers, _set_handlers),
    _Item(
        lambda: signal.pthread_sigmask(signal.SIG_BLOCK, ()),
        lambda wanted: signal.pthread_sigmask(signal.SIG_SETMASK, wanted),
    ),
    _Item(_logging, _set_logging),
    _attributes(sys, *_STREAMS),
    _attributes(sys, *_HOOKS),
    _attributes(threading, "excepthook"),
    _mapping(vars(builtins)),
    _settings("sys", ("gettrace", "settrace"), ("getprofile", "setprofile")),
    _settings("sys", ("getrecursionlimit", "setrecursionlimit")),
    _settings("sys", ("getswitchinterval", "setswitchinterval")),
    _Item(_umask, os.umask),
    _Item(_priority, _set_priority),
    _Item(lambda: (gc.isenabled(), gc.get_threshold()), _set_collector),
    _Item(lambda: locale.setlocale(locale.LC_ALL), lambda value: locale.setlocale(locale.LC_ALL, value)),
    _settings("numpy", ("geterr", "seterr"), ("get_printoptions", "set_printoptions")),
    _settings(
        "torch",
        ("get_default_dtype", "set_default_dtype"),
        ("get_num_threads", "set_num_threads"),
        ("is_grad_enabled", "set_grad_enabled"),
        ("are_deterministic_algorithms_enabled", "use_deterministic_algorithms"),
    ),
    _settings("cv2", ("getNumThreads", "setNumThreads")),
)
