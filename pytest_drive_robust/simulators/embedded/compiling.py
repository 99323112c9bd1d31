"""Compile the kernels of the embedded world, its cameras and the agents imported so far."""

from __future__ import annotations

import os
from collections.abc import Callable

from pytest_drive_robust.jit import compile_all
from pytest_drive_robust.jit.compile_all import Compilation
from pytest_drive_robust.jit.compiled_functions import Tell
from pytest_drive_robust.jit.kernels import ENTRIES
from pytest_drive_robust.simulators.embedded import world  # noqa: F401 - importing it makes its kernels known


def compile_kernels(tell: Tell) -> int:
    """Compile the kernels that the cache lacks, load all kernels, and return how many were missing.

    `tell(done, total)` is called as functions are compiled.
    """
    _import_cameras()
    return compile_all.compile_all(processes=_processes(), tell=tell)


def begin_compiling(import_others: Callable[[], None], tell: Tell, *, cameras: bool) -> Compilation:
    """Compile and load the kernels of the agents imported so far, with or without `cameras`; then begin with the rest.

    The rest are the kernels of the cameras and of the modules that `import_others` imports.
    """
    if cameras:
        _import_cameras()
    first = tuple(ENTRIES)
    _import_cameras()
    import_others()
    return Compilation(first, processes=_processes(), tell=tell)


def missing_functions() -> int:
    """Return how many functions are not compiled yet, of all agents and cameras."""
    _import_cameras()
    return compile_all.missing_functions()


def _import_cameras() -> None:
    """Register the kernels of cameras; late, because an agent without cameras drives before these are compiled."""
    from pytest_drive_robust.simulators.embedded import camera  # noqa: F401


def _processes() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
