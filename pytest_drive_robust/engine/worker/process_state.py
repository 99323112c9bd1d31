"""Restores what an agent may change in its process besides its own memory, after each episode.

An episode must not depend on the episodes that its process drove before.
"""

from __future__ import annotations

import _thread
import builtins
import gc
import locale
import logging
import os
import resource
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Mapping, MutableMapping, Sequence
from contextlib import suppress
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

from pytest_drive_robust.engine.worker.system import child_processes, descriptor_identity, resident_bytes
from pytest_drive_robust.runner.episode.after_import import AfterImport

_MOST_FILES = 100
_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "displayhook", "breakpointhook", "unraisablehook")
_SUBNORMAL = 5e-324
_SIGNALS = sorted(signal.valid_signals() - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")})
_RESOURCES = sorted({getattr(resource, name) for name in dir(resource) if name.startswith("RLIMIT_")})


class _Item(NamedTuple):
    """One setting of the process: how to read and write it. The setting exists only once `module` is loaded."""

    read: Callable[[], Any]
    write: Callable[[Any], object]
    module: str = "builtins"


def read_process_state() -> dict[int, Any]:
    """Return the present value of each item, by its number, for `restore_process_state`."""
    return _read(module for module in {item.module for item in _ITEMS} if module in sys.modules)


def add_late_modules(state: dict[int, Any]) -> None:
    """Add the items of a module to `state` as soon as the module is loaded, before an agent can change them."""
    for name in {item.module for item in _ITEMS} - set(sys.modules):
        AfterImport(name, lambda module: state.update(_read([module.__name__]))).wait()


def restore_process_state(wanted: Mapping[int, Any]) -> bool:
    """Give each item its `wanted` value again; return whether all items have it then."""
    return all([_restore(_ITEMS[number], value) for number, value in wanted.items()])  # noqa: C419 - each of them


def _read(modules: Iterable[str]) -> dict[int, Any]:
    """Return the values of these modules' items, by number; an item that cannot be read is left out."""
    wanted, state = set(modules), {}
    for number, item in enumerate(_ITEMS):
        if item.module in wanted:
            with suppress(Exception):  # an older torch lacks some; torch refuses mixed TF32 settings
                state[number] = item.read()
    return state


def _restore(item: _Item, value: Any) -> bool:
    try:
        with suppress(Exception):  # see `_read`: a write makes the item readable again
            if item.read() == value:
                return True
        item.write(value)
        return bool(item.read() == value)
    except Exception:  # for example the folder is gone: a new process must drive
        return False


class Leftovers:
    """Finds what an episode left that cannot be restored, so that the process is replaced.

    Looks for new threads and child processes, changed `descriptors` (those are ours), many open files, and more than
    `growth_bytes` of growth since the first episode.
    """

    def __init__(self, descriptors: Sequence[int], *, growth_bytes: int) -> None:
        self._threads = _thread._count()
        self._descriptors = {number: descriptor_identity(number) for number in descriptors}
        self._files = _open_files()
        self._growth_bytes = growth_bytes
        self._first_bytes = 0

    def found(self) -> bool:
        """Return whether an episode left anything. Call after each episode."""
        size_bytes = resident_bytes()
        self._first_bytes = self._first_bytes or size_bytes
        return (
            max(_thread._count(), threading.active_count() - 1) > self._threads
            or bool(child_processes())  # also orphans: a worker is a subreaper
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
    """Return the item for an attribute of a module or an object."""
    return _Item(lambda: getattr(owner, name), partial(setattr, owner, name))


def _pair(module: str, getter: str, setter: str) -> _Item:
    """Return the item that two functions of a module read and write; a dictionary is written as keywords."""

    def write(wanted: Any) -> None:
        function = getattr(sys.modules[module], setter)
        function(**wanted) if isinstance(wanted, dict) else function(wanted)

    return _Item(lambda: getattr(sys.modules[module], getter)(), write, module)


def _torch(path: str) -> _Item:
    """Return the item for an attribute below torch, such as "backends.mkldnn.enabled"."""
    owner, _, name = path.rpartition(".")

    def write(wanted: Any) -> None:
        setattr(attrgetter(owner)(sys.modules["torch"]), name, wanted)

    return _Item(lambda: attrgetter(path)(sys.modules["torch"]), write, "torch")


def _list(owner: Any, name: str) -> _Item:
    """Return the item for the elements of a list that stays the same object."""

    def write(wanted: list[Any]) -> None:
        getattr(owner, name)[:] = wanted

    return _Item(lambda: list(getattr(owner, name)), write)


def _mapping(owner: MutableMapping[str, Any]) -> _Item:
    """Return the item for the content of a mapping that stays the same object."""

    def write(wanted: dict[str, Any]) -> None:
        for key in set(owner) - set(wanted):
            del owner[key]
        owner.update(wanted)

    return _Item(lambda: dict(owner), write)


def _timer(which: int) -> _Item:
    return _Item(lambda: signal.getitimer(which), lambda wanted: signal.setitimer(which, *wanted))


def _keeps_subnormals() -> bool:
    """Return True when this thread computes with subnormal numbers, False when it flushes them to 0."""
    return _SUBNORMAL * 4.0 > 0.0


def _keep_subnormals(wanted: bool) -> None:
    sys.modules["torch"].set_flush_denormal(not wanted)  # ONNX Runtime can set this, too, but not undo it


def _set_default_device(wanted: Any) -> None:
    sys.modules["torch"].set_default_device(None if wanted.type == "cpu" else wanted)  # None costs nothing per call


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
    *(_Item(partial(resource.getrlimit, number), partial(resource.setrlimit, number)) for number in _RESOURCES),
    _Item(lambda: os.getpriority(os.PRIO_PROCESS, 0), partial(os.setpriority, os.PRIO_PROCESS, 0)),
    *([_Item(lambda: os.sched_getaffinity(0), partial(os.sched_setaffinity, 0))] if sys.platform == "linux" else []),
    _Item(gc.isenabled, lambda wanted: gc.enable() if wanted else gc.disable()),
    _Item(gc.get_threshold, lambda wanted: gc.set_threshold(*wanted)),
    _Item(partial(locale.setlocale, locale.LC_ALL), partial(locale.setlocale, locale.LC_ALL)),
    _pair("numpy", "geterr", "seterr"),
    _pair("numpy", "get_printoptions", "set_printoptions"),
    _Item(_keeps_subnormals, _keep_subnormals),
    _pair("torch", "get_default_dtype", "set_default_dtype"),
    _Item(lambda: sys.modules["torch"].get_default_device(), _set_default_device, "torch"),
    _pair("torch", "get_num_threads", "set_num_threads"),
    _pair("torch", "is_grad_enabled", "set_grad_enabled"),
    _pair("torch", "are_deterministic_algorithms_enabled", "use_deterministic_algorithms"),
    _torch("backends.mkldnn.enabled"),
    *(_torch(f"backends.cudnn.{name}") for name in ("enabled", "benchmark", "deterministic", "allow_tf32")),
    _torch("backends.cuda.matmul.allow_tf32"),
    _torch("backends.cuda.matmul.allow_fp16_reduced_precision_reduction"),
    _torch("backends.cuda.matmul.allow_bf16_reduced_precision_reduction"),
    _pair("torch", "get_float32_matmul_precision", "set_float32_matmul_precision"),
    # after the items above, whose setters change some of these
    *(_torch(f"backends.{name}fp32_precision") for name in ("", "cuda.matmul.", "cudnn.", "cudnn.conv.", "cudnn.rnn.")),
    *(_torch(f"backends.mkldnn.{name}fp32_precision") for name in ("", "matmul.", "conv.", "rnn.")),
    _pair("cv2", "getNumThreads", "setNumThreads"),
)
