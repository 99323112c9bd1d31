"""Write graphs for ONNX Runtime: the computation of a network, one graph for each of its methods.

A graph holds no weights. Each weight is an external tensor at its place in the weight file, in half precision, followed
by a node that casts it. A graph therefore depends only on the network's specification: two trainings of one network
have equal graphs, and any ONNX program can open a graph with the weight file beside it.
"""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from drive_robust_agents._nets import require
from drive_robust_agents._nets.manifest import GraphFile, WeightsEntry
from drive_robust_agents._nets.weights import header_of
from pytest_drive_robust.store.whole_file import write_whole

__all__ = ["write_graphs"]

_OPSET = 20
_FORWARD = "forward"
_ROWS = 2
"""Rows of the traced batch; a single row would be taken for a constant."""

_PREFIX = "net."


def write_graphs(net: nn.Module, path: Path, content: bytes, entry: WeightsEntry) -> WeightsEntry:
    """Write a graph for each method of the network beside the weight file `path` with this content.

    Gives the entry with the graphs listed. Raises `UsageError` without the extra `train`.
    """
    require("onnx", extra="train")
    plain = _distinct(net)
    begin, header = header_of(content)
    places = {name: (begin, facts) for name, facts in header.items() if name != "__metadata__"}
    files = {}
    for method, example in _examples(plain).items():
        graph = _graph(plain, method, example, places, path.name)
        file = f"{path.stem}.onnx" if method == _FORWARD else f"{path.stem}_{method}.onnx"
        write_whole(path.with_name(file), graph)
        files[method] = GraphFile(file, hashlib.sha256(graph).hexdigest(), len(graph))
    return dataclasses.replace(entry, graphs=files)


class _Method(nn.Module):
    """A method of the network with positional inputs and a tuple of outputs, as the exporter requires."""

    def __init__(self, net: nn.Module, method: str, names: Sequence[str]) -> None:
        super().__init__()
        self.net, self._method, self._names = net, method, tuple(names)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Return the outputs in the order of their dictionary."""
        return tuple(getattr(self.net, self._method)(**dict(zip(self._names, inputs, strict=True))).values())


def _distinct(net: nn.Module) -> nn.Module:
    """Return a copy with distinct numbers in every tensor, because the exporter merges equal tensors."""
    plain = copy.deepcopy(net).cpu().requires_grad_(False).eval()
    generator = torch.Generator().manual_seed(0)
    for value in plain.state_dict().values():
        if value.is_floating_point():
            value.copy_(torch.rand(value.shape, generator=generator) + 0.5)
    return plain


def _examples(net: Any) -> Mapping[str, Mapping[str, Tensor]]:
    parts = net.parts(_ROWS) if hasattr(net, "parts") else {}
    return {_FORWARD: net.example(_ROWS), **parts}


def _graph(
    net: nn.Module, method: str, example: Mapping[str, Tensor], places: Mapping[str, tuple[int, Any]], location: str
) -> bytes:
    """Trace a method; its weights are at `places` (offset of the data, header entry) in the file `location`.

    The graph contains all tensors of the file, even if the method does not read them: ONNX Runtime must know every
    given tensor, and drops unused tensors.
    """
    import onnx
    from onnx import TensorProto, helper

    model = onnx.load_from_string(_exported(net, method, example))
    casts = []
    named = {tensor.name for tensor in model.graph.initializer}
    unknown = sorted(named - {_PREFIX + name for name in places})
    assert not unknown, unknown  # a constant of the network is a node, not a tensor of the file
    del model.graph.initializer[:]
    for name, (begin, facts) in places.items():
        first, last = facts["data_offsets"]
        tensor = TensorProto(name=name, data_type=TensorProto.FLOAT16, dims=facts["shape"])
        tensor.data_location = TensorProto.EXTERNAL
        for key, value in (("location", location), ("offset", begin + first), ("length", last - first)):
            tensor.external_data.add(key=key, value=str(value))
        model.graph.initializer.append(tensor)
        casts.append(helper.make_node("Cast", [name], [_PREFIX + name], to=TensorProto.FLOAT))
    nodes = list(model.graph.node)
    for node in nodes:
        node.ClearField("doc_string")  # contains a traceback with paths
    del model.graph.node[:]
    model.graph.node.extend([*casts, *nodes])
    content: bytes = model.SerializeToString(deterministic=True)
    return content


def _exported(net: nn.Module, method: str, example: Mapping[str, Tensor]) -> bytes:
    wrapped = _Method(net, method, list(example)).eval()
    with warnings.catch_warnings(), torch.no_grad(), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "graph.onnx"
        outputs = list(getattr(net, method)(**example))
        warnings.simplefilter("ignore")  # the tracing exporter is deprecated, but the only one without a compiler
        torch.onnx.export(
            wrapped,
            tuple(example.values()),
            file,
            input_names=list(example),
            output_names=outputs,
            dynamic_axes={name: {0: "rows"} for name in (*example, *outputs)},
            opset_version=_OPSET,
            dynamo=False,
            do_constant_folding=False,
            training=torch.onnx.TrainingMode.PRESERVE,  # else the exporter folds statistics of norms into weights
        )
        return file.read_bytes()
