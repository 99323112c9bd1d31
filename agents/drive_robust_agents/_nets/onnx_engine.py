"""ONNX Runtime: the engine that agents drive with unless they ask for another.

A graph holds the computation, the weight file the numbers. Both are read and verified once, and ONNX Runtime gets the
verified bytes. While loading, ONNX Runtime converts the file's half precision to single precision and folds constants.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from drive_robust_agents._nets.manifest import MANIFEST, WeightsEntry
from drive_robust_agents._nets.weights import ADVICE, tensors_of, verified_bytes, verified_graph
from pytest_drive_robust.errors import UsageError

__all__ = ["OnnxEngine"]

_ERRORS_ONLY = 3


class OnnxEngine:
    """A session for each graph of a weight file, for batches of any size.

    Raises `UsageError` for files that differ from the manifest.
    """

    def __init__(self, path: Path, entry: WeightsEntry, *, architecture: str, threads: int = 1) -> None:
        if not entry.graphs:
            raise UsageError(
                f"{path.with_name(MANIFEST)} lists no graph of {entry.label}, which ONNX Runtime needs: write "
                f"one with `python -m drive_robust_agents.training graphs {path}`, or give engine='torch'."
            )
        tensors = tensors_of(path, entry, verified_bytes(path, entry), architecture=architecture)
        self._path, self._threads = path, threads
        self._tensors = {name: onnxruntime.OrtValue.ortvalue_from_numpy(value) for name, value in tensors.items()}
        self._sessions = {
            method: self._session(graph.file, verified_graph(path, entry, graph))
            for method, graph in entry.graphs.items()
        }

    def __call__(self, method: str, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Run the graph of a method. Raises `UsageError` for a method without a graph."""
        if method not in self._sessions:
            known = ", ".join(sorted(self._sessions))
            raise UsageError(f"there is no graph of {method!r} beside {self._path}, only of {known}.")
        session = self._sessions[method]
        given = {name: np.ascontiguousarray(value) for name, value in inputs.items()}
        names = [output.name for output in session.get_outputs()]
        return dict(zip(names, session.run(names, given), strict=True))

    def _session(self, name: str, graph: bytes) -> onnxruntime.InferenceSession:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = self._threads, 1
        options.log_severity_level = _ERRORS_ONLY
        options.add_external_initializers(list(self._tensors), list(self._tensors.values()))
        try:
            return onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime's errors have no common base class
            path = self._path.with_name(name)
            raise UsageError(
                f"{path} is no graph that fits {self._path.name}: {str(error).strip()}. {ADVICE}"
            ) from None
