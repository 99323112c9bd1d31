"""Graphs for ONNX Runtime: what a network computes, written down once for each of its methods.

A graph holds no weights. Each is an external tensor at its place in the weight file, in half precision as there, behind
a node that casts it: so a graph follows from the network's specification alone, two trainings of one network have equal
graphs, and any program that reads ONNX can open one where the weight file lies beside it.
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
"""Of the traced batch: one would be taken for a constant."""

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
    """A method of the network with inputs by position and outputs as a tuple, as the exporter wants them."""

    def __init__(self, net: nn.Module, method: str, names: Sequence[str]) -> None:
        super().__init__()
        self.net, self._method, self._names = net, method, tuple(names)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Return the outputs in the order of their dictionary."""
        return tuple(getattr(self.net, self._method)(**dict(zip(self._names, inputs, strict=True))).values())


def _distinct(net: nn.Module) -> nn.Module:
    """Return a copy with other numbers in every tensor: the exporter makes one of two tensors that are equal."""
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
    """Trace a method; its weights are those at `places` (where the data begins, header entry) in the file `location`.

    All tensors of the file are in the graph, also those that the method does not read: ONNX Runtime wants to know every
    one that it is given, and drops what leads nowhere.
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
        node.ClearField("doc_string")  # the traceback, with paths
    del model.graph.node[:]
    model.graph.node.extend([*casts, *nodes])
    content: bytes = model.SerializeToString(deterministic=True)
    return content


def _exported(net: nn.Module, method: str, example: Mapping[str, Tensor]) -> bytes:
    wrapped = _Method(net, method, list(example)).eval()
    with warnings.catch_warnings(), torch.no_grad(), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "graph.onnx"
        outputs = list(getattr(net, method)(**example))
        warnings.simplefilter("ignore")  # the exporter by tracing is old, and the only one that needs no compiler
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
            training=torch.onnx.TrainingMode.PRESERVE,  # else it folds the statistics of norms into other weights
        )
        return file.read_bytes()
