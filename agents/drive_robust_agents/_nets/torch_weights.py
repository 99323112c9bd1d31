"""Convert between weight files and torch networks, for inference and for further training."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from drive_robust_agents._nets import require
from drive_robust_agents._nets.blocks import channels_last, fold_batch_norm
from drive_robust_agents._nets.manifest import WeightsEntry, plain_spec
from drive_robust_agents._nets.weights import ADVICE, Tensors, header_of, locate, metadata, tensors_of, verified_bytes
from pytest_drive_robust.errors import UsageError

__all__ = ["Build", "begin_with", "encode", "load"]

Build = Callable[[Mapping[str, Any]], nn.Module]
"""Makes a network of a plain specification: `TcpNet.build`."""

_UNSTORED = "num_batches_tracked"


def load(name: str, build: Build, *, weights: str | Path | None = None) -> tuple[nn.Module, WeightsEntry]:
    """Return the network of an agent, ready to infer: frozen, in evaluation mode, batch normalisation folded.

    Raises `UsageError` unless the file is exactly what the manifest lists and the agent builds.
    """
    path, entry = locate(name, weights)
    content = verified_bytes(path, entry)
    net = _built(path, entry, build)
    _fill(net, tensors_of(path, entry, content, architecture=type(net).__name__), path)
    net.requires_grad_(False).eval()
    return channels_last(fold_batch_norm(net)), entry


def begin_with(net: nn.Module, name: str, weights: str | Path) -> None:
    """Put published weights into a network that goes on learning. Raises `UsageError` as `load` does."""
    path, entry = locate(name, weights)
    content = verified_bytes(path, entry)
    _fill(net, tensors_of(path, entry, content, architecture=type(net).__name__), path)


def encode(net: nn.Module, spec: object) -> bytes:
    """Encode a weight file: every parameter and statistic in half precision, with the metadata to check."""
    require("safetensors", extra="train")
    import safetensors.torch

    state = {
        name: (value.half() if value.is_floating_point() else value).detach().cpu().contiguous()
        for name, value in net.state_dict().items()
        if not name.endswith(_UNSTORED)
    }
    wild = [name for name, value in state.items() if value.is_floating_point() and not bool(value.isfinite().all())]
    if wild:
        raise UsageError(f"these weights are no finite half-precision numbers: {', '.join(wild)}.")
    return _in_order(safetensors.torch.save(state, metadata=metadata(type(net).__name__, plain_spec(spec))))


def _in_order(content: bytes) -> bytes:
    """Return the file with a sorted header: safetensors writes metadata in random order, so digests would differ.

    Spaces pad the header to a multiple of 8 bytes, as in safetensors.
    """
    begin, known = header_of(content)
    header = json.dumps(known, sort_keys=True, separators=(",", ":")).encode()
    header += b" " * (-len(header) % 8)
    return len(header).to_bytes(8, "little") + header + content[begin:]


def _built(path: Path, entry: WeightsEntry, build: Build) -> nn.Module:
    try:
        return build(entry.spec)
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{path}: no {entry.architecture} can be built as {entry.label} specifies: {error}. {ADVICE}"
        ) from error


def _fill(net: nn.Module, tensors: Tensors, path: Path) -> None:
    """Copy every tensor into the network; raise `UsageError` for a missing or an extra tensor."""
    own = net.state_dict()
    expected = {name: tuple(value.shape) for name, value in own.items() if not name.endswith(_UNSTORED)}
    given = {name: value.shape for name, value in tensors.items()}
    if given != expected:
        differ = sorted(name for name in {*given, *expected} if given.get(name) != expected.get(name))
        some = ", ".join(f"{name} {given.get(name)} instead of {expected.get(name)}" for name in differ[:3])
        raise UsageError(
            f"{path} does not hold the tensors of {type(net).__name__}: {len(differ)} differ ({some}). {ADVICE}"
        )
    full: dict[str, Tensor] = {
        name: torch.from_numpy(np.array(tensors[name])).to(value.dtype) if name in tensors else value
        for name, value in own.items()
    }
    net.load_state_dict(full, strict=True)
