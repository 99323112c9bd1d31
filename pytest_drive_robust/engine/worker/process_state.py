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
from functools import partial
from typing import Any, NamedTuple

from pytest_drive_robust.engine.worker.system import child_processes, descriptor_identity, resident_bytes

_MOST_FILES = 100
_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "displayhook", "breakpointhook", "unraisablehook")
_SIGNALS = sorted(signal.valid_signals() - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")})


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
        self._descriptors = {number: descriptor_identity(number) for number in descriptors}
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
            or any(descriptor_identity(number) != known for number, known in self._descriptors.items())
            or _open_files() - self._files > _MOST_FILES
            or size_bytes - self._first_bytes > self._growth_bytes
        )


def _open_files() -> int:
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return 0


def _attribute(owner: Any, name: str) -> _Item:
    """Look after an attribute of a module or an object."""
    return _Item(lambda: getattr(owner, name), partial(setattr, owner, name))


def _pair(module: str, getter: str, setter: str) -> _Item:
    """Look after what two functions of a module read and write; a dictionary is written as keywords."""

    def write(wanted: Any) -> None:
        function = getattr(sys.modules[module], setter)
        function(**wanted) if isinstance(wanted, dict) else function(wanted)

    return _Item(lambda: getattr(sys.modules[module], getter)(), write, module)


def _list(owner: Any, name: str) -> _Item:
    """Look after the elements of a list that stays the same object."""

    def write(wanted: list[Any]) -> None:
        getattr(owner, name)[:] = wanted

    return _Item(lambda: list(getattr(owner, name)), write)


def _mapping(owner: MutableMapping[str, Any]) -> _Item:
    """Look after the content of a mapping that stays the same object."""

    def write(wanted: dict[str, Any]) -> None:
        for key in set(owner) - set(wanted):
            del owner[key]
        owner.update(wanted)

    return _Item(lambda: dict(owner), write)


def _timer(which: int) -> _Item:
    return _Item(lambda: signal.getitimer(which), lambda wanted: signal.setitimer(which, *wanted))


def _umask() -> int:
    now = os.umask(0o077)
    os.umask(now)
    return now


_ITEMS = (
    _Item(os.getcwd, os.chdir),
    _mapping(os.environ),
    _list(sys, "path"),
    _list(warnings, "filters"),
    _attribute(warnings, "showwarning"),
    *map(_timer, (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)),
    *(_Item(partial(signal.getsignal, number), partial(signal.signal, number)) for number in _SIGNALS),
    _Item(partial(signal.pthread_sigmask, signal.SIG_BLOCK, ()), partial(signal.pthread_sigmask, signal.SIG_SETMASK)),
    _Item(lambda: logging.root.level, logging.root.setLevel),
    _Item(lambda: logging.root.manager.disable, logging.disable),
    _attribute(logging.root, "disabled"),
    _list(logging.root, "handlers"),
    _list(logging.root, "filters"),
    *(_attribute(sys, name) for name in (*_STREAMS, *_HOOKS)),
    _attribute(threading, "excepthook"),
    _mapping(vars(builtins)),
    _pair("sys", "gettrace", "settrace"),
    _pair("sys", "getprofile", "setprofile"),
    _pair("sys", "getrecursionlimit", "setrecursionlimit"),
    _pair("sys", "getswitchinterval", "setswitchinterval"),
    _Item(_umask, os.umask),
    _Item(lambda: os.getpriority(os.PRIO_PROCESS, 0), partial(os.setpriority, os.PRIO_PROCESS, 0)),
    *([_Item(lambda: os.sched_getaffinity(0), partial(os.sched_setaffinity, 0))] if sys.platform == "linux" else []),
    _Item(gc.isenabled, lambda wanted: gc.enable() if wanted else gc.disable()),
    _Item(gc.get_threshold, lambda wanted: gc.set_threshold(*wanted)),
    _Item(partial(locale.setlocale, locale.LC_ALL), partial(locale.setlocale, locale.LC_ALL)),
    _pair("numpy", "geterr", "seterr"),
    _pair("numpy", "get_printoptions", "set_printoptions"),
    _pair("torch", "get_default_dtype", "set_default_dtype"),
    _pair("torch", "get_num_threads", "set_num_threads"),
    _pair("torch", "is_grad_enabled", "set_grad_enabled"),
    _pair("torch", "are_deterministic_algorithms_enabled", "use_deterministic_algorithms"),
    _pair("cv2", "getNumThreads", "setNumThreads"),
)
