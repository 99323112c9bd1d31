"""What an agent may change of its process besides its own memory: put back after each episode.

An episode must not depend on which ones its process drove before.
"""

from __future__ import annotations

import builtins
import gc
import locale
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

__all__ = ["read_process_state", "restore_process_state"]

_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "displayhook", "breakpointhook", "unraisablehook")
_SIGNALS = sorted(signal.valid_signals() - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")})


class _Item(NamedTuple):
    """One thing to look after. `module`: only when that one is loaded."""

    name: str
    read: Callable[[], Any]
    write: Callable[[Any], object]
    module: str = "builtins"


def read_process_state() -> Mapping[str, Any]:
    """How things are now."""
    return {item.name: item.read() for item in _ITEMS if item.module in sys.modules}


def restore_process_state(wanted: Mapping[str, Any]) -> tuple[str, ...]:
    """Make things as they were; the names of those that cannot be."""
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


def _set_environment(wanted: dict[str, str]) -> None:
    for name in set(os.environ) - set(wanted):
        del os.environ[name]
    for name, value in wanted.items():
        if os.environ.get(name) != value:
            os.environ[name] = value


def _set_path(wanted: list[str]) -> None:
    sys.path[:] = wanted


def _set_filters(wanted: list[Any]) -> None:
    warnings.filters[:] = wanted  # type: ignore[index]


def _handlers() -> dict[int, Any]:
    return {number: signal.getsignal(number) for number in _SIGNALS}


def _set_handlers(wanted: dict[int, Any]) -> None:
    for number, handler in wanted.items():
        if handler is not None and signal.getsignal(number) != handler:
            signal.signal(number, handler)


def _mask() -> set[int]:
    return set(signal.pthread_sigmask(signal.SIG_BLOCK, ()))


def _set_mask(wanted: set[int]) -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, wanted)


def _alarmed() -> bool:
    return any(signal.getitimer(which)[0] > 0 for which in _TIMERS)


def _set_alarmed(wanted: bool) -> None:
    for which in _TIMERS:
        signal.setitimer(which, 0)


_TIMERS = (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF)


def _logging() -> tuple[Any, ...]:
    root = logging.root
    return (root.level, tuple(root.handlers), tuple(root.filters), root.disabled, root.manager.disable)


def _set_logging(wanted: tuple[Any, ...]) -> None:
    root = logging.root
    level, handlers, filters, root.disabled, root.manager.disable = wanted
    root.setLevel(level)
    root.handlers[:], root.filters[:] = handlers, filters


def _of_sys(names: tuple[str, ...]) -> Callable[[], tuple[Any, ...]]:
    return lambda: tuple(getattr(sys, name) for name in names)


def _set_sys(names: tuple[str, ...]) -> Callable[[tuple[Any, ...]], None]:
    def write(wanted: tuple[Any, ...]) -> None:
        for name, value in zip(names, wanted, strict=True):
            setattr(sys, name, value)

    return write


def _set_thread_hook(wanted: Any) -> None:
    threading.excepthook = wanted


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


def _watchers() -> tuple[Any, Any]:
    return sys.gettrace(), sys.getprofile()


def _set_watchers(wanted: tuple[Any, Any]) -> None:
    sys.settrace(wanted[0])
    sys.setprofile(wanted[1])


def _collector() -> tuple[bool, tuple[int, int, int]]:
    return gc.isenabled(), gc.get_threshold()


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


def _numpy() -> tuple[dict[str, Any], dict[str, Any]]:
    np: Any = sys.modules["numpy"]
    return dict(np.geterr()), dict(np.get_printoptions())


def _set_numpy(wanted: tuple[dict[str, Any], dict[str, Any]]) -> None:
    np: Any = sys.modules["numpy"]
    np.seterr(**wanted[0])
    np.set_printoptions(**wanted[1])


def _torch() -> tuple[Any, ...]:
    torch: Any = sys.modules["torch"]
    return (
        torch.get_default_dtype(),
        torch.get_num_threads(),
        torch.is_grad_enabled(),
        torch.are_deterministic_algorithms_enabled(),
    )


def _set_torch(wanted: tuple[Any, ...]) -> None:
    torch: Any = sys.modules["torch"]
    dtype, threads, grad, deterministic = wanted
    torch.set_default_dtype(dtype)
    torch.set_num_threads(threads)
    torch.set_grad_enabled(grad)
    torch.use_deterministic_algorithms(deterministic)


def _cv2() -> int:
    return int(sys.modules["cv2"].getNumThreads())


def _set_cv2(wanted: int) -> None:
    sys.modules["cv2"].setNumThreads(wanted)


_ITEMS = (
    _Item("the current folder", os.getcwd, os.chdir),
    _Item("the environment", lambda: dict(os.environ), _set_environment),
    _Item("sys.path", lambda: list(sys.path), _set_path),
    _Item("warning filters", lambda: list(warnings.filters), _set_filters),
    _Item("warnings.showwarning", lambda: warnings.showwarning, lambda value: setattr(warnings, "showwarning", value)),
    _Item("timers", _alarmed, _set_alarmed),
    _Item("signal handlers", _handlers, _set_handlers),
    _Item("the signal mask", _mask, _set_mask),
    _Item("logging", _logging, _set_logging),
    _Item("standard streams", _of_sys(_STREAMS), _set_sys(_STREAMS)),
    _Item("hooks of sys", _of_sys(_HOOKS), _set_sys(_HOOKS)),
    _Item("threading.excepthook", lambda: threading.excepthook, _set_thread_hook),
    _Item("builtins", _builtins, _set_builtins),
    _Item("tracing", _watchers, _set_watchers),
    _Item("the recursion limit", sys.getrecursionlimit, sys.setrecursionlimit),
    _Item("the switch interval", sys.getswitchinterval, sys.setswitchinterval),
    _Item("the file mode mask", _umask, os.umask),
    _Item("the priority", _priority, _set_priority),
    _Item("the garbage collector", _collector, _set_collector),
    _Item("the locale", lambda: locale.setlocale(locale.LC_ALL), lambda value: locale.setlocale(locale.LC_ALL, value)),
    _Item("numpy", _numpy, _set_numpy, module="numpy"),
    _Item("torch", _torch, _set_torch, module="torch"),
    _Item("OpenCV", _cv2, _set_cv2, module="cv2"),
)
