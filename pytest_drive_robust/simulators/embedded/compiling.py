"""Compile the kernels of the embedded world, its cameras and the agents imported so far."""

from __future__ import annotations

import os
from collections.abc import Callable

from pytest_drive_robust.jit import compile_all
from pytest_drive_robust.simulators.embedded import camera, world

__all__ = ["compile_kernels", "missing_functions"]

_WITH_KERNELS = (camera, world)
"""Importing them makes their kernels known."""


def compile_kernels(tell: Callable[[int, int], None]) -> int:
    """Compile what the cache lacks and load everything; return how many kernels were missing.

    `tell(done, total)` hears of functions being compiled.
    """
    processes = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return compile_all.compile_all(processes=processes, tell=tell)


def missing_functions() -> int:
    """Return how many functions have to be compiled before everything can be driven."""
    return compile_all.missing_functions()
