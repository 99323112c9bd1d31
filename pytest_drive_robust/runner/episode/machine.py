"""Computes digests of a few fixed results on this machine, stored with the episodes whose bits depend on the machine.

The embedded world, the perturbations and agents with `portable_bits` give the same bits on every machine. Other agents
and worlds compute with the C library, numpy, torch or ONNX Runtime, which choose their code by the processor: episodes
of two machines may differ when these digests differ. The digests are part of no key.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import FunctionType
from typing import Any

import numpy as np

from pytest_drive_robust.domain.agent import computing_modules, has_portable_bits
from pytest_drive_robust.domain.result import MACHINE_FACTS, EpisodeResult
from pytest_drive_robust.runner.cache_key.digests import hex_of
from pytest_drive_robust.runner.cache_key.distributions import versions_of
from pytest_drive_robust.runner.cache_key.source_files import UnknownSourceError, imported_versions
from pytest_drive_robust.simulators.base import Simulator

_ANY_CODE = ("libm", "numpy")
"""Libraries that code may use when it declares nothing."""
_HEAVY = ("torch", "onnxruntime")
"""Libraries that agents load, never this package."""
_SIZE = 37
"""Size of the test arrays: no multiple of any vector width, so that the ends of loops are computed, too, and so small
that no library uses several threads, whose number would change the bits of a product."""
_PROBE = (
    b'\x08\x08:j\n\x12\n\x01x\n\x01x\x12\x02xx"\x06MatMul\n\r\n\x02xx\x12\x01y"\x04Tanh\x12\x05probe'
    b"Z\x13\n\x01x\x12\x0e\n\x0c\x08\x01\x12\x08\n\x02\x08%\n\x02\x08%b\x14\n\x02xx\x12\x0e\n\x0c\x08\x01\x12\x08\n\x02\x08%\n\x02\x08%"
    b"b\x13\n\x01y\x12\x0e\n\x0c\x08\x01\x12\x08\n\x02\x08%\n\x02\x08%B\x04\n\x00\x10\r"
)
"""The model `y = tanh(x @ x)` of 37 x 37 numbers in the ONNX format; writing it would need another package."""


def with_machine(result: EpisodeResult, agent: object, world: Simulator) -> EpisodeResult:
    """Return the result with `versions` of libraries and digests of the machine added to the world's versions.

    `agent` is the agent that drove, or its factory.
    """
    return replace(result, versions={**library_versions(agent), **result.versions, **machine_facts(agent, world)})


def machine_facts(agent: object = None, world: object = None) -> Mapping[str, str]:
    """Return a digest (12 hex digits) of each library on this machine that an episode of the agent depends on.

    The libraries are the modules that the agent names in `computed_by`. For an agent that names none they are the C
    library and numpy, and torch and ONNX Runtime if the agent holds objects of them. A world without `portable_bits`
    adds the C library and numpy. Imports of other agents do not matter: an episode gets the same entries in every
    process and order.
    """
    named = computing_modules(agent)
    if named is None:
        named = (*_ANY_CODE, *(module for module in _HEAVY if agent is not None and _holds(agent, module)))
    if not has_portable_bits(world):
        named = (*_ANY_CODE, *named)
    facts = ((name, name.removeprefix("machine ")) for name in MACHINE_FACTS)
    return {
        name: _COMPUTED[module]()
        for name, module in facts
        if module in named and (module not in _HEAVY or module in sys.modules)
    }


def library_versions(agent: object) -> Mapping[str, str]:
    """Return the versions that the keys of the agent's episodes hold."""
    modules = computing_modules(agent)
    if modules is None:
        return _imported(agent if isinstance(agent, (type, FunctionType)) else type(agent))
    return versions_of(modules) if modules else {}


@functools.cache
def _imported(code: type | FunctionType) -> Mapping[str, str]:
    try:
        return imported_versions(code)
    except UnknownSourceError:
        return versions_of(())


@functools.cache
def _of_libm() -> str:
    line = [(3.0 * step - 54.0) / 18.0 for step in range(_SIZE)]
    scalars = [(math.sin(x), math.exp(x), math.tanh(x), math.atan2(x, 0.3), abs(x) ** 0.7) for x in line]
    return hex_of(repr(scalars).encode())


@functools.cache
def _of_numpy() -> str:
    line = np.linspace(-3.0, 3.0, _SIZE)
    square = np.sin(np.outer(line, line + 0.1))
    results: list[Any] = []
    for kind in (np.float64, np.float32):
        values, matrix = line.astype(kind), square.astype(kind)
        results += [np.sin(values), np.exp(values), np.tanh(values), np.arctan2(values, values[::-1])]
        results += [np.hypot(values, 0.3), np.power(np.abs(values), kind(0.7)), values.sum(), matrix.sum(axis=0)]
        results += [matrix @ values, matrix @ matrix, np.einsum("ij,j->i", matrix, values)]
    results.append(np.linalg.solve(square + 20.0 * np.eye(_SIZE), line))
    results.append(np.fft.rfft(line))
    return hex_of(b"".join(np.ascontiguousarray(result).tobytes() for result in results))


@functools.cache
def _of_torch() -> str:
    torch: Any = sys.modules["torch"]
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.no_grad():
            line = torch.linspace(-3.0, 3.0, _SIZE, dtype=torch.float32, device="cpu")
            square = torch.sin(torch.outer(line, line + 0.1))
            image = square[: _SIZE - 1].reshape(1, 3, 12, _SIZE)
            kernel = square[:9, :9].reshape(3, 3, 3, 3)
            results = [
                torch.tanh(line), torch.exp(line), torch.sigmoid(line), torch.softmax(square, 1), square @ line,
                square @ square, torch.nn.functional.conv2d(image, kernel),
                torch.nn.functional.layer_norm(square, (_SIZE,)),
            ]  # fmt: skip
            return hex_of(b"".join(result.contiguous().numpy().tobytes() for result in results))
    finally:
        torch.set_num_threads(threads)


@functools.cache
def _of_onnxruntime() -> str:
    """Return the digest of a matrix product and a tanh, computed by an ONNX model."""
    runtime: Any = sys.modules["onnxruntime"]
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = runtime.InferenceSession(_PROBE, options, providers=["CPUExecutionProvider"])
    line = np.arange(_SIZE * _SIZE, dtype=np.float32) % 101 / np.float32(100.0) - np.float32(0.5)
    return hex_of(b"".join(found.tobytes() for found in session.run(None, {"x": line.reshape(_SIZE, _SIZE)})))


_COMPUTED: Mapping[str, Callable[[], str]] = {
    "libm": _of_libm, "numpy": _of_numpy, "torch": _of_torch, "onnxruntime": _of_onnxruntime,
}  # fmt: skip


def _holds(agent: object, library: str) -> bool:
    """Return whether the agent, its attributes or its module hold an object of the library."""
    if library not in sys.modules:
        return False
    module = sys.modules.get(type(agent).__module__)
    kept = (agent, *getattr(agent, "__dict__", {}).values(), *getattr(module, "__dict__", {}).values())
    return any(_is_of(value, library) for value in kept)


def _is_of(value: object, library: str) -> bool:
    kinds = value.__mro__ if isinstance(value, type) else type(value).__mro__
    names = [kind.__module__ for kind in kinds]
    names += [value.__name__] if isinstance(value, type(sys)) else []
    return any(isinstance(name, str) and name.partition(".")[0] == library for name in names)
