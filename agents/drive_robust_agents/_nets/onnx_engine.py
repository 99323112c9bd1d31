"""ONNX Runtime in place of eager torch: the same weights, about twice as fast at one row on a CPU.

The model is built from the verified weights at first use (a few seconds) and kept in the user's cache, under a name
that changes with the weights, the options and the versions that built it. There is one source of weights.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from drive_robust_agents._nets import require
from drive_robust_agents._nets.manifest import WeightsEntry
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.whole_file import whole_file

__all__ = ["OnnxEngine", "cache_folder"]

_OPSET = 20
_FORMAT = 1


class OnnxEngine:
    """One session for batches of any size. Raises `UsageError` without the extra `onnx`."""

    def __init__(
        self, net: nn.Module, entry: WeightsEntry, *, options: Sequence[tuple[str, object]] = (), threads: int = 1
    ) -> None:
        require("onnxruntime", "onnx", extra="onnx")
        import onnxruntime

        settings = onnxruntime.SessionOptions()
        settings.intra_op_num_threads = threads
        settings.inter_op_num_threads = 1
        settings.log_severity_level = 3
        path = cache_folder() / f"{_model_name(entry, options)}.onnx"
        if not path.is_file():
            _export(net, path)
        self._session = onnxruntime.InferenceSession(str(path), settings, providers=["CPUExecutionProvider"])
        self._outputs = [output.name for output in self._session.get_outputs()]

    def __call__(self, method: str, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Run the model. The method can only be `forward`."""
        if method != "forward":
            raise UsageError(f"engine='onnx' cannot compute {method!r} of this agent: give engine='torch'.")
        given = {name: np.ascontiguousarray(value) for name, value in inputs.items()}
        return dict(zip(self._outputs, self._session.run(self._outputs, given), strict=True))


def cache_folder() -> Path:
    """Return `$XDG_CACHE_HOME/pytest-drive-robust/onnx` or the like under the home folder."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "pytest-drive-robust" / "onnx"


def _model_name(entry: WeightsEntry, options: Sequence[tuple[str, object]]) -> str:
    facts = (entry.sha256, tuple(options), torch.__version__, _OPSET, _FORMAT)
    return f"{entry.name}-{hashlib.sha256(repr(facts).encode()).hexdigest()[:24]}"


class _Named(nn.Module):
    """The network with inputs by position and outputs as a tuple, as the exporter wants them."""

    def __init__(self, net: nn.Module, names: Sequence[str]) -> None:
        super().__init__()
        self._net, self._names = net, tuple(names)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Return the outputs in the order of their dictionary."""
        return tuple(self._net(**dict(zip(self._names, inputs, strict=True))).values())


def _export(net: Any, path: Path) -> None:
    """Trace the network and put the model into place in one move: several processes may do so at once."""
    example: dict[str, Tensor] = net.example(2)
    with torch.inference_mode():
        outputs = list(net(**example))
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as temporary, warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # the exporter by tracing is old, and the only one that needs no compiler
        torch.onnx.export(
            _Named(net, list(example)).eval(),
            tuple(example.values()),
            str(temporary),
            input_names=list(example),
            output_names=outputs,
            dynamic_axes={name: {0: "rows"} for name in (*example, *outputs)},
            opset_version=_OPSET,
            dynamo=False,
        )
