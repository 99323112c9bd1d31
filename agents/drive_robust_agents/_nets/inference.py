"""Networks at run time: numpy in, numpy out, the same bits for a row whatever other rows there are.

One row is computed as a batch of one. Several rows are computed in batches of `ROWS`, the last one filled up with
copies: so the bits of a row depend neither on its neighbours nor on how many they are. Networks are shared by all
agents of a process that ask for the same weights in the same way; what an episode remembers belongs to its agent.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from drive_robust_agents._nets import weights as store
from drive_robust_agents._nets.manifest import WeightsEntry
from drive_robust_agents._nets.torch_engine import TYPES, TorchEngine
from pytest_drive_robust.errors import UsageError, nearest

__all__ = ["ROWS", "Network", "Policy"]

ROWS = 4
"""Rows of a batch. With one size for all the sums of a matrix product are added in the same order everywhere."""

_ENGINES = ("torch", "onnx")

_Arrays = Mapping[str, NDArray[Any]]


class Network(Protocol):
    """What an agent needs of a `Policy`."""

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        """Run a method of the network on all rows at once: arrays with the rows as their first axis."""
        ...


class Engine(Protocol):
    """Computes one batch of fixed size with a method of the network."""

    def __call__(self, method: str, inputs: _Arrays) -> dict[str, NDArray[Any]]:
        """Compute arrays from arrays, each with the batch as its first axis."""
        ...


@dataclass(frozen=True, slots=True)
class _PolicyKey:
    """Everything that distinguishes one policy from another."""

    name: str
    build: store.Build
    engine: str
    device: str
    dtype: str
    threads: int
    file: Path | None
    sha256: str
    options: tuple[tuple[str, object], ...]


class Policy:
    """A network with its weights, ready to drive. Make one with `Policy.of`."""

    def __init__(self, net: nn.Module, entry: WeightsEntry, engine: Engine, *, threads: int) -> None:
        self.net, self.entry = net, entry
        self._engine, self._threads = engine, threads

    @classmethod
    def of(
        cls,
        name: str,
        build: store.Build,
        *,
        engine: str = "torch",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
        **options: object,
    ) -> Policy:
        """Return the policy of an agent; the same object for the same key in this process.

        `engine` is `"torch"` or `"onnx"` (ONNX Runtime: faster on a CPU, built from the same weights at first use).
        `device` is `"cpu"`, `"cuda"`, `"cuda:1"` or `"auto"`. `dtype` other than `"float32"` computes with automatic
        mixed precision and is meant for CUDA: processors without instructions for it are many times slower.
        `weights` is None for those that ship, or a file with its `manifest.json` beside it. `options` are those of the
        network. Raises `UsageError` for weights that are refused and for what this machine cannot do.
        """
        _, entry = store.locate(name, weights)
        key = _PolicyKey(
            name,
            build,
            _one_of("engine", engine, _ENGINES),
            _device(device, engine),
            _one_of("dtype", dtype, tuple(TYPES)),
            threads,
            None if weights is None else Path(weights).absolute(),
            entry.sha256,
            tuple(sorted(options.items())),
        )
        if threads < 1 or (engine == "onnx" and dtype != "float32"):
            raise UsageError(
                f"threads={threads} with engine={engine!r}, dtype={dtype!r}: expected float32 and 1 or more."
            )
        with _making:
            return _made(key)

    @classmethod
    def check(cls, name: str, build: store.Build, *, weights: str | Path | None = None, **options: object) -> None:
        """Refuse at once what `of` would refuse: nothing is driven with weights that are not what they should be."""
        store.load(name, build, weights=weights, **options)

    @property
    def label(self) -> str:
        """`name@version:sha8`."""
        return self.entry.label

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Run the network on rows of inputs (each array with the rows as its first axis).

        Returns when the result is there, on any device. `method` names another method of the network with the same
        conventions; ONNX Runtime knows `forward` only.
        """
        if torch.get_num_threads() != self._threads:
            torch.set_num_threads(self._threads)
        rows = len(next(iter(inputs.values())))
        if rows == 1:
            return self._engine(method, inputs)
        parts = [self._engine(method, _chunk(inputs, begin)) for begin in range(0, rows, ROWS)]
        return {name: np.concatenate([part[name] for part in parts])[:rows] for name in parts[0]}


_making = threading.Lock()


@functools.cache
def _made(key: _PolicyKey) -> Policy:
    torch.set_num_threads(key.threads)
    net, entry = store.load(key.name, key.build, weights=key.file, **dict(key.options))
    if entry.sha256 != key.sha256:
        raise UsageError(f"{key.name}: the manifest changed while its weights were read. Start again.")
    if key.engine == "torch":
        engine: Engine = TorchEngine(net, device=key.device, dtype=key.dtype)
    else:
        from drive_robust_agents._nets.onnx_engine import OnnxEngine

        engine = OnnxEngine(net, entry, options=key.options, threads=key.threads)
    return Policy(net, entry, engine, threads=key.threads)


def _chunk(inputs: _Arrays, begin: int) -> dict[str, NDArray[Any]]:
    """Return `ROWS` rows from `begin`, copies of the last one where there are no more."""
    rows = len(next(iter(inputs.values())))
    places = np.minimum(np.arange(begin, begin + ROWS), rows - 1)
    return {name: value[places] for name, value in inputs.items()}


def _one_of(what: str, given: str, known: tuple[str, ...]) -> str:
    if given not in known:
        close = nearest(given, known)
        hint = "" if close is None else f" Did you mean {close!r}?"
        raise UsageError(f"{what}={given!r}: expected one of {', '.join(map(repr, known))}.{hint}")
    return given


def _device(given: str, engine: str) -> str:
    """Return the device of that name. Raises `UsageError` when this machine has none."""
    if given == "auto":
        return "cuda" if engine == "torch" and torch.cuda.is_available() else "cpu"
    try:
        kind = torch.device(given).type
    except RuntimeError:
        kind = ""
    if kind not in ("cpu", "cuda") or (kind == "cuda" and (engine == "onnx" or not torch.cuda.is_available())):
        raise UsageError(
            f"device={given!r} with engine={engine!r}: expected 'cpu', 'auto', or with a CUDA build of torch and a "
            f"device that it sees 'cuda' (torch {torch.__version__} sees {torch.cuda.device_count()})."
        )
    return given
