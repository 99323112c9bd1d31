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
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from pytest_drive_robust.engine.worker.system import child_processes

__all__ = ["Leftovers", "read_process_state", "restore_process_state"]

_MOST_FILES = 100
_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "displayhook", "breakpointhook", "unraisablehook")
_SIGNALS = sorted(signal.valid_signals() - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")})
_TIMERS = (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)


class _Item(NamedTuple):
    """One thing to look after. `module`: only when that one is loaded."""

    name: str
    read: Callable[[], Any]
    write: Callable[[Any], object]
    module: str = "builtins"


def read_process_state() -> Mapping[str, Any]:
    """Return how things are now."""
    return {item.name: item.read() for item in _ITEMS if item.module in sys.modules}


def restore_process_state(wanted: Mapping[str, Any]) -> tuple[str, ...]:
    """Make things as they were; return the names of those that cannot be."""
    stuck = []
    for item in _ITEMS:
        if item.name not in wanted:
            continue
        value = wanted[item.name]
        try:
            if item.read() != value:
                item.write(value)
                if item.read() != value:
                    stuck.append(item.name)
        except Exception:  # the folder is gone, a handler cannot be installed, ...: another process can
            stuck.append(item.name)
    return tuple(stuck)


class Leftovers:
    """What is not as it was when this was made and cannot be put back: then the process is replaced.

    `descriptors` are ours and must stay what they are.
    """

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
        children = child_processes()  # with those of children that ended: a worker is a subreaper
        if children:
            problems.append(f"{len(children)} child processes")
        if any(_identity(number) != known for number, known in self._descriptors.items()):
            problems.append("descriptors that were closed")
        if _open_files() - self._files > _MOST_FILES:
            problems.append(f"more than {_MOST_FILES} open files")
        return tuple(problems)


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


def _attributes(name: str, owner: Any, *attributes: str) -> _Item:
    """Look after attributes of a module."""

    def write(wanted: tuple[Any, ...]) -> None:
        for attribute, value in zip(attributes, wanted, strict=True):
            setattr(owner, attribute, value)

    return _Item(name, lambda: tuple(getattr(owner, attribute) for attribute in attributes), write)


def _settings(name: str, module: str, *pairs: tuple[str, str]) -> _Item:
    """Look after what pairs of functions of a module read and write; a dictionary is written as keywords."""

    def read() -> tuple[Any, ...]:
        found = (getattr(sys.modules[module], getter)() for getter, _ in pairs)
        return tuple(dict(value) if isinstance(value, dict) else value for value in found)

    def write(wanted: tuple[Any, ...]) -> None:
        for (_, setter), value in zip(pairs, wanted, strict=True):
            function = getattr(sys.modules[module], setter)
            function(**value) if isinstance(value, dict) else function(value)

    return _Item(name, read, write, module)


def _list(name: str, owner: Any, attribute: str) -> _Item:
    """Look after the elements of a list that stays the same object."""

    def write(wanted: list[Any]) -> None:
        getattr(owner, attribute)[:] = wanted

    return _Item(name, lambda: list(getattr(owner, attribute)), write)


def _set_environment(wanted: dict[str, str]) -> None:
    for name in set(os.environ) - set(wanted):
        del os.environ[name]
    os.environ.update(wanted)


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


def _set_builtins(wanted: dict[str, Any]) -> None:
    names = vars(builtins)
    for name in set(names) - set(wanted):
        del names[name]
    names.update(wanted)


def _builtins() -> dict[str, Any]:
    return {name: value for name, value in vars(builtins).items() if name != "_"}


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
    _Item("the current folder", os.getcwd, os.chdir),
    _Item("the environment", lambda: dict(os.environ), _set_environment),
    _list("sys.path", sys, "path"),
    _list("warning filters", warnings, "filters"),
    _attributes("warnings.showwarning", warnings, "showwarning"),
    _Item("timers", _has_timer, _stop_timers),
    _Item("signal handlers", _handlers, _set_handlers),
    _Item(
        "the signal mask",
        lambda: signal.pthread_sigmask(signal.SIG_BLOCK, ()),
        lambda wanted: signal.pthread_sigmask(signal.SIG_SETMASK, wanted),
    ),
    _Item("logging", _logging, _set_logging),
    _attributes("standard streams", sys, *_STREAMS),
    _attributes("hooks of sys", sys, *_HOOKS),
    _attributes("threading.excepthook", threading, "excepthook"),
    _Item("builtins", _builtins, _set_builtins),
    _settings("tracing", "sys", ("gettrace", "settrace"), ("getprofile", "setprofile")),
    _settings("the recursion limit", "sys", ("getrecursionlimit", "setrecursionlimit")),
    _settings("the switch interval", "sys", ("getswitchinterval", "setswitchinterval")),
    _Item("the file mode mask", _umask, os.umask),
    _Item("the priority", _priority, _set_priority),
    _Item("the garbage collector", lambda: (gc.isenabled(), gc.get_threshold()), _set_collector),
    _Item("the locale", lambda: locale.setlocale(locale.LC_ALL), lambda value: locale.setlocale(locale.LC_ALL, value)),
    _settings("numpy", "numpy", ("geterr", "seterr"), ("get_printoptions", "set_printoptions")),
    _settings(
        "torch",
        "torch",
        ("get_default_dtype", "set_default_dtype"),
        ("get_num_threads", "set_num_threads"),
        ("is_grad_enabled", "set_grad_enabled"),
        ("are_deterministic_algorithms_enabled", "use_deterministic_algorithms"),
    ),
    _settings("OpenCV", "cv2", ("getNumThreads", "setNumThreads")),
)
