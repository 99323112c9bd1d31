"""`drive-robust warm`: compile everything now, for container images and CI caches."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import default_registry

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_PROBE_BYTES = 1 << 16
_AGENTS = ("expert", "reactive", "classical", "constant", "random")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `drive-robust warm`."""
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    parser.set_defaults(command=_warm)


def _warm(options: argparse.Namespace) -> int:
    """Compile all kernels of the simulator, the cameras, the criteria and the reference agents."""
    if not options.here:  # only a process with one thread may fork; libraries read these variables when they are loaded
        command = (sys.executable, "-m", "pytest_drive_robust.cli", "warm", "--here")
        return subprocess.run(command, env={**os.environ, **_ONE_THREAD}, check=False).returncode
    from pytest_drive_robust.jit.cache import cache_folder  # loads numba
    from pytest_drive_robust.simulators.embedded.compiling import compile_kernels, missing_functions

    registry, began_s = default_registry(), time.monotonic()
    for name in _AGENTS:
        with suppress(UsageError):  # the agents are a distribution of their own
            registry.require("agents", name)
    problem = _why_unwritable(cache_folder())
    if problem and missing_functions():  # to compile for minutes would be of no use to later runs
        raise UsageError(
            f"compiled kernels cannot be kept in {str(cache_folder())!r}: {problem}. Make room there, or let "
            "NUMBA_CACHE_DIR name a folder that can be written to, here and where the kernels are used."
        )
    count = compile_kernels(_show if sys.stderr.isatty() else lambda done, total: None)
    seconds = time.monotonic() - began_s
    print(
        f"compiled {count} kernels in {seconds:.0f} s: {cache_folder()}"
        if count
        else f"all kernels were compiled: {cache_folder()}"
    )
    return 0


def _why_unwritable(folder: Path) -> str:
    """Return why no file can be written to a folder, which is made if it is missing; empty where one can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(_PROBE_BYTES))
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _show(done: int, total: int) -> None:
    sys.stderr.write(f"\rcompiling {done} of {total} functions" + ("\n" if done == total else ""))
