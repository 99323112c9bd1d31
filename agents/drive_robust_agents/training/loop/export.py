"""Export the weights of a training: half precision, with graphs, verified by reading back, listed in a manifest."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import nn

from drive_robust_agents._nets import torch_weights
from drive_robust_agents._nets import weights as store
from drive_robust_agents._nets.manifest import MOST_BYTES, WeightsEntry, plain_spec, read_manifest, write_entry
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.loop.onnx_graphs import write_graphs
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.store.whole_file import write_whole

if TYPE_CHECKING:
    from drive_robust_agents.training.loop.trainer import TrainingOptions
    from drive_robust_agents.training.recipes.recipe import TrainingRecipe

__all__ = ["publish", "write_weights"]


def write_weights(net: nn.Module, folder: Path, *, options: TrainingOptions, step: int) -> Path:
    """Write `NAME.safetensors`, its graphs and its manifest into a folder; return the weight file.

    Raises `UsageError` for a file that is too large.
    """
    spec: Any = net.spec
    content = torch_weights.encode(net, spec)
    if len(content) > MOST_BYTES:
        raise UsageError(f"the weights have {len(content)} bytes, at most {MOST_BYTES} ship: make the network smaller.")
    name = options.agent
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.safetensors"
    write_whole(path, content)
    entry = WeightsEntry(
        name=name,
        version="0.0",
        file=path.name,
        sha256=hashlib.sha256(content).hexdigest(),
        size_bytes=len(content),
        architecture=type(net).__name__,
        spec=plain_spec(spec),
        parameters=sum(parameter.numel() for parameter in net.parameters()),
        provenance={
            "trainer": {**asdict(options), "step": step},
            "simulator": EmbeddedSimulator.version,
            "torch": torch.__version__.partition("+")[0],
        },
    )
    write_entry(folder, write_graphs(net, path, content, entry))
    return path


def publish(
    file: Path, folder: Path, *, recipe: TrainingRecipe, version: str, score: Mapping[str, Any], note: str
) -> WeightsEntry:
    """Copy chosen weights and their graphs into a folder, such as the package's; return the manifest entry.

    The manifest gets version, rig and closed-loop score. The files are verified before the copy and loaded after it.
    Raises `UsageError`.
    """
    entry = read_manifest(file.parent, recipe.name)
    contents = {entry.file: store.verified_bytes(file, entry)}
    contents |= {graph.file: store.verified_graph(file, entry, graph) for graph in entry.graphs.values()}
    rig = [asdict(camera) for camera in agent_rig(recipe.name).cameras]
    provenance = {**entry.provenance, "note": note, "rig": rig, "score": score}
    entry = replace(entry, version=version, provenance=provenance)
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        write_whole(folder / name, content)
    write_entry(folder, entry)
    torch_weights.load(recipe.name, lambda spec: recipe.make(spec), weights=folder / entry.file)
    return entry
