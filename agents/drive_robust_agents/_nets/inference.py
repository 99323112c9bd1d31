"""Networks at run time: numpy in, numpy out; the bits of a row do not depend on other rows.

One row is computed as a batch of one. Several rows are computed in batches of `ROWS`, the last batch filled up with
copies, so that the bits of a row depend neither on its neighbours nor on their number. All agents of a process with
equal weights and options share one network; the memory of an episode belongs to its agent. Neither ONNX Runtime nor
torch is imported before a network is made.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets import weights as store
from drive_robust_agents._nets.answer import GENERATE, answer_and_drive
from drive_robust_agents._nets.engine_options import device_of, require_possible
from drive_robust_agents._nets.manifest import WeightsEntry
from pytest_drive_robust.errors import UsageError

__all__ = ["ROWS", "Engine", "LoadedNetwork", "Network"]

ROWS = 4
"""Rows of a batch. One size for all batches keeps the order in which the sums of a matrix product are added."""

_Arrays = Mapping[str, NDArray[Any]]


class Network(Protocol):
    """The part of `LoadedNetwork` that agents use."""

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        """Run a method of the network on all rows at once: arrays with the rows as their first axis."""
        ...


class Engine(Protocol):
    """Computes one batch of fixed size with a method of the network."""

    def __call__(self, method: str, inputs: _Arrays) -> dict[str, NDArray[Any]]:
        """Compute arrays from arrays, each with the batch as its first axis."""
        ...


@dataclass(frozen=True, slots=True)
class _NetworkKey:
    """The key of a loaded network; `content` are the digests of its files."""

    name: str
    network_class: str
    engine: str
    device: str
    dtype: str
    threads: int
    file: Path | None
    content: tuple[str, ...]


class LoadedNetwork:
    """A network with its weights, ready to drive; made by `LoadedNetwork.of`."""

    def __init__(self, entry: WeightsEntry, engine: Engine) -> None:
        self.entry, self.engine = entry, engine

    @classmethod
    def of(
        cls,
        name: str,
        network_class: str,
        *,
        engine: str = "onnx",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
    ) -> LoadedNetwork:
        """Return the network of an agent; equal arguments give one shared object per process.

        `network_class` is the module and the class of the network, `"tcp:TcpNet"`. `engine` is `"onnx"` (ONNX Runtime,
        on a CPU) or `"torch"`. `device` is `"cpu"`, `"auto"` or, with torch, `"cuda"` or `"cuda:1"`. A `dtype` other
        than `"float32"` computes with torch's automatic mixed precision and is meant for CUDA; processors without
        instructions for that type are many times slower. `weights` is None for the shipped weights, or a file with its
        `manifest.json` beside it. Raises `UsageError` for refused weights, and for an engine, device or dtype that this
        machine lacks.
        """
        require_possible(engine, dtype, threads)
        _, entry = store.locate(name, weights)
        key = _NetworkKey(
            name,
            network_class,
            engine,
            device_of(device, engine),
            dtype,
            threads,
            None if weights is None else Path(weights).absolute(),
            _digests(entry),
        )
        with _making:
            return _made(key)

    @classmethod
    def check(
        cls,
        name: str,
        network_class: str,
        *,
        engine: str = "onnx",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
    ) -> None:
        """Raise the `UsageError` that `of` would raise, devices aside: verify the files, make no network."""
        require_possible(engine, dtype, threads)
        path, entry = store.locate(name, weights)
        store.tensors_of(path, entry, store.verified_bytes(path, entry), architecture=_architecture_of(network_class))
        for graph in entry.graphs.values():
            store.verified_graph(path, entry, graph)

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Run the network on rows of inputs (each array with the rows as its first axis).

        Returns when the result is complete, on any device. `method` names another method of the network with equal
        conventions, or is `"generate"` for a network that answers before driving.
        """
        rows = len(next(iter(inputs.values())))
        if rows == 1:
            return self._computed(method, inputs)
        parts = [self._computed(method, _chunk(inputs, begin)) for begin in range(0, rows, ROWS)]
        return {name: np.concatenate([part[name] for part in parts])[:rows] for name in parts[0]}

    def _computed(self, method: str, inputs: _Arrays) -> dict[str, NDArray[Any]]:
        return answer_and_drive(self.engine, inputs) if method == GENERATE else self.engine(method, inputs)


_making = threading.Lock()


@functools.cache
def _made(key: _NetworkKey) -> LoadedNetwork:
    path, entry = store.locate(key.name, key.file)
    if _digests(entry) != key.content:
        raise UsageError(f"{key.name}: the manifest changed while its weights were read. Start again.")
    engine: Engine
    if key.engine == "torch":
        from drive_robust_agents._nets.torch_engine import TorchEngine
        from drive_robust_agents._nets.torch_weights import load

        module, _, cls = key.network_class.partition(":")
        build = getattr(import_module(f"{__package__}.{module}"), cls).build
        net, entry = load(key.name, build, weights=key.file)
        engine = TorchEngine(net, device=key.device, dtype=key.dtype, threads=key.threads)
    else:
        from drive_robust_agents._nets.onnx_engine import OnnxEngine

        engine = OnnxEngine(path, entry, architecture=_architecture_of(key.network_class), threads=key.threads)
    return LoadedNetwork(entry, engine)


def _digests(entry: WeightsEntry) -> tuple[str, ...]:
    return (entry.sha256, *(graph.sha256 for graph in entry.graphs.values()))


def _architecture_of(network_class: str) -> str:
    """Return the name by which manifests know a class such as `"tcp:TcpNet"`: `"TcpNet"`."""
    return network_class.partition(":")[2]


def _chunk(inputs: _Arrays, begin: int) -> dict[str, NDArray[Any]]:
    """Return `ROWS` rows from `begin`, filled up with copies of the last row."""
    rows = len(next(iter(inputs.values())))
    places = np.minimum(np.arange(begin, begin + ROWS), rows - 1)
    return {name: value[places] for name, value in inputs.items()}
