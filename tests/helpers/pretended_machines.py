"""Machines that this one can pretend to be: libraries told to choose other code, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = ["MACHINES", "OLD", "PLAIN", "RUNNING", "SAME", "Driven", "Machine", "drive_on", "gathered", "lines_on"]

SAME = "the same"
"""What `driven_digests` says in the place of a digest of stored controls that gave the stored trajectory again."""

_SCRIPT = Path(__file__).with_name("driven_digests.py")
_ROOT = Path(__file__).parent.parent.parent

_TOLD = {
    *("GLIBC_TUNABLES", "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "OPENCV_CPU_DISABLE", "NUMBA_CPU_NAME"),
    *("NUMBA_CPU_FEATURES", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "NUMBA_NUM_THREADS"),
    *("ATEN_CPU_CAPABILITY", "ONEDNN_MAX_CPU_ISA", "MKL_ENABLE_INSTRUCTIONS"),
}
_NO_WIDE = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4"
"""By the names of old and of new versions of numpy, which says of each of the others that it does not know it."""


@dataclass(frozen=True)
class Machine:
    """One way for the libraries to choose their code; `shows` names what of `driven_digests.libraries` must change."""

    name: str
    environment: Mapping[str, str] = field(default_factory=dict)
    shows: tuple[str, ...] = ()


@dataclass(frozen=True)
class Driven:
    """What a process drove: digests and scores by `agent | route | setting`, and what its libraries compute."""

    digests: Mapping[str, str]
    scores: Mapping[str, float]
    stored: Mapping[str, Any]
    libraries: Mapping[str, str]

    def unlike(self, other: Driven) -> list[str]:
        """Return the labels whose digests are not the same."""
        return [label for label in self.digests if other.digests.get(label) != self.digests[label]]

    def changed(self, other: Driven) -> tuple[str, ...]:
        """Return the libraries that compute something else there."""
        return tuple(name for name, value in self.libraries.items() if other.libraries[name] != value)


PLAIN = Machine("as it is")

_GLIBC = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable,-AVX_Usable"}
_NUMPY = {"NPY_DISABLE_CPU_FEATURES": f"AVX2 FMA3 X86_V3 {_NO_WIDE}"}
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "NUMBA_NUM_THREADS")
_OPENCV = {"OPENCV_CPU_DISABLE": "AVX512-ICL,AVX512-SKX,AVX2,FP16,FMA3,AVX,SSE4.2,SSE4.1"}

MACHINES = (
    Machine("C library without FMA, AVX2, AVX512", _GLIBC, ("libm",)),
    Machine("OpenBLAS for Prescott (SSE3)", {"OPENBLAS_CORETYPE": "Prescott"}, ("BLAS",)),
    Machine("OpenBLAS for Haswell (AVX2)", {"OPENBLAS_CORETYPE": "Haswell"}, ("BLAS",)),
    Machine("OpenBLAS for SkylakeX (AVX512)", {"OPENBLAS_CORETYPE": "SkylakeX"}, ("BLAS",)),
    Machine("numpy without AVX2, FMA3, AVX512", _NUMPY, ("numpy",)),
    Machine("numpy without AVX512", {"NPY_DISABLE_CPU_FEATURES": _NO_WIDE}, ("numpy",)),
    Machine("OpenCV without AVX, FMA3, AVX512", _OPENCV, ("OpenCV code",)),
    Machine("numba for any x86-64", {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}, ("numba",)),
    Machine("numba for x86-64-v3 (FMA)", {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": ""}, ("numba",)),
    Machine("one thread", dict.fromkeys(_THREADS, "1"), ("threads",)),
    Machine("four threads", dict.fromkeys(_THREADS, "4"), ("threads",)),
    Machine(
        "torch without AVX",
        {"ATEN_CPU_CAPABILITY": "default", "ONEDNN_MAX_CPU_ISA": "SSE41", "MKL_ENABLE_INSTRUCTIONS": "SSE4_2"},
    ),
)
"""`shows` is what changes where the processor can choose at all: an old one takes the plain code by itself."""

OLD = Machine(
    "all of these at once, but numba",
    {**_GLIBC, **_NUMPY, **_OPENCV, **dict.fromkeys(_THREADS, "1"), "OPENBLAS_CORETYPE": "Prescott"},
    ("libm", "numpy", "BLAS", "OpenCV code"),
)


RUNNING: set[subprocess.Popen[str]] = set()
"""The processes that drive now."""


def drive_on(
    machine: Machine,
    *,
    agents: Sequence[str],
    routes: str,
    settings: Sequence[str],
    **more: Any,
) -> Driven:
    """Drive every agent on the routes under the settings in a process of its own.

    `more` are entries of the order that `driven_digests` takes: `every`, `ticks`, `keep`, `stored`. Raises
    `RuntimeError` with what the process said when it fails.
    """
    order = {"agents": list(agents), "routes": routes, "settings": list(settings), **more}
    return gathered(lines_on(machine, order))


def gathered(lines: Iterable[Mapping[str, Any]]) -> Driven:
    """Return what the lines of `driven_digests` tell together."""
    digests, scores, stored, libraries = {}, {}, {}, {}
    for line in lines:
        libraries = line.get("libraries", libraries)
        if "label" in line:
            label = line["label"]
            digests[label] = line["digest"]
            scores.update({label: line["score"]} if "score" in line else {})
            stored.update({label: line["stored"]} if "stored" in line else {})
    return Driven(digests, scores, stored, libraries)


def lines_on(machine: Machine, order: Mapping[str, Any], python: str = sys.executable) -> Iterator[dict[str, Any]]:
    """Yield what `driven_digests` prints on that machine as soon as it does. `python` drives this checkout, too.

    Raises `RuntimeError` with what the process said when it fails.
    """
    environment = {name: value for name, value in os.environ.items() if name not in _TOLD} | dict(machine.environment)
    environment["PYTHONPATH"] = os.pathsep.join(map(str, (_ROOT, _ROOT / "agents")))
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file, tempfile.TemporaryFile("w+") as errors:
        json.dump(order, file)
        file.flush()
        command = [python, str(_SCRIPT), f"@{file.name}"]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=errors, text=True)
        RUNNING.add(process)
        try:
            assert process.stdout is not None
            yield from map(json.loads, process.stdout)
            process.wait()
        finally:
            process.kill()
            process.communicate()
            RUNNING.discard(process)
        if process.returncode != 0:
            errors.seek(0)
            raise RuntimeError(f"{machine.name}: exit {process.returncode}: {errors.read()[-3000:]}")
