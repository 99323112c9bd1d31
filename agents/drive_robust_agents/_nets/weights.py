"""Shipped weights: safetensors in half precision, listed in a manifest, verified before use.

The order of loading: the manifest's entry, the size, the SHA-256 of the bytes, the header's metadata against the entry,
the architecture against the agent's, then every tensor by name and shape. A weight file or graph contains no code and
does not decide which network is built. A file that fails any step is refused with `UsageError`. No torch here.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.manifest import (
    FORMAT_VERSION,
    MANIFEST,
    MOST_BYTES,
    GraphFile,
    WeightsEntry,
    read_manifest,
)
from pytest_drive_robust.errors import UsageError

__all__ = [
    "ADVICE", "SHIPPED", "Tensors", "header_of", "locate", "metadata", "tensors_of", "verified_bytes",
    "verified_graph",
]  # fmt: skip

Tensors = Mapping[str, NDArray[Any]]
"""Arrays by the names of a network's parameters and statistics."""

SHIPPED = Path(__file__).parent.parent / "weights"
"""The folder of the weights that ship."""

ADVICE = "Install drive-robust-agents again, or give weights of your own with their manifest.json beside them."

_PICKLES = (b"PK", *(bytes((0x80, protocol)) for protocol in range(2, 6)))
"""The first bytes of files by `torch.save` and `pickle.dump`."""
_TYPES = {"F16": np.float16, "F32": np.float32, "F64": np.float64, "I64": np.int64, "I32": np.int32, "U8": np.uint8}
"""Types of tensors in a safetensors file; little-endian, as are all machines that we support."""


def locate(name: str, weights: str | Path | None = None) -> tuple[Path, WeightsEntry]:
    """Return the weight file and the manifest entry of an agent: the shipped file, or `weights` with its manifest."""
    folder = SHIPPED if weights is None else Path(weights).absolute().parent
    entry = read_manifest(folder, name)
    path = folder / entry.file
    if weights is not None and path != Path(weights).absolute():
        raise UsageError(f"{folder / MANIFEST} lists {entry.file!r} for {name!r}, not {Path(weights).name!r}.")
    return path, entry


def verified_bytes(path: Path, entry: WeightsEntry) -> bytes:
    """Return the content of a weight file. Raises `UsageError` unless it equals the manifest's entry to the byte."""
    return _verified(path, entry.size_bytes, entry.sha256, entry.label)


def verified_graph(path: Path, entry: WeightsEntry, graph: GraphFile) -> bytes:
    """Return the content of a graph; `path` is the weight file.

    Raises `UsageError` unless the content equals the manifest's entry to the byte.
    """
    return _verified(path.with_name(graph.file), graph.size_bytes, graph.sha256, entry.label)


def tensors_of(path: Path, entry: WeightsEntry, content: bytes, *, architecture: str) -> Tensors:
    """Return the tensors of a weight file as views of `content`.

    Raises `UsageError` for another kind of file, for a header that differs from the manifest, and for weights of
    another network than `architecture`.
    """
    try:
        begin, header = header_of(content)
        given = header.pop("__metadata__", {})
        data = memoryview(content)[begin:]
        tensors = {name: _tensor(data, **facts) for name, facts in header.items()}
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        kind = " It looks like a pickle, which we never open." if content[:2] in _PICKLES else ""
        raise UsageError(f"{path} is no safetensors file: {error}.{kind} {ADVICE}") from None
    expected = metadata(entry.architecture, entry.spec)
    wrong = [name for name, value in expected.items() if given.get(name) != value]
    if wrong:
        told = "; ".join(f"{name} is {given.get(name)!r}, the manifest says {expected[name]!r}" for name in wrong)
        raise UsageError(f"the header of {path} does not fit the manifest: {told}. {ADVICE}")
    if entry.architecture != architecture:
        raise UsageError(f"{path} holds weights of {entry.architecture}, expected those of {architecture}. {ADVICE}")
    return tensors


def header_of(content: bytes) -> tuple[int, dict[str, Any]]:
    """Return the offset of the tensors in a weight file in bytes, and the header. Raises `ValueError` without a header.

    A file is the header's length in 8 bytes, the header (JSON), and the tensors one after the other.
    """
    begin = 8 + int.from_bytes(content[:8], "little")
    return begin, json.loads(content[8:begin])


def metadata(architecture: str, spec: Mapping[str, Any]) -> dict[str, str]:
    """Return the metadata that the header of a weight file has for a network."""
    return {"arch": architecture, "spec": json.dumps(spec, sort_keys=True), "format_version": str(FORMAT_VERSION)}


def _verified(path: Path, size_bytes: int, sha256: str, label: str) -> bytes:
    try:
        size = path.stat().st_size
        if size > MOST_BYTES or size != size_bytes:
            raise UsageError(
                f"{path} has {size} bytes, expected {size_bytes} (at most {MOST_BYTES}): it is truncated or not "
                f"the file of {label}. {ADVICE}"
            )
        content = path.read_bytes()
    except OSError as error:
        raise UsageError(f"the weights {path} cannot be read: {error.strerror}. {ADVICE}") from None
    digest = hashlib.sha256(content).hexdigest()
    if digest != sha256:
        raise UsageError(f"{path} has SHA-256 {digest}, the manifest says {sha256}: it was changed. {ADVICE}")
    return content


def _tensor(data: memoryview, *, dtype: str, shape: list[int], data_offsets: list[int]) -> NDArray[Any]:
    begin, end = data_offsets
    values = np.frombuffer(data[begin:end], dtype=_TYPES[dtype])
    if min((begin, *shape)) < 0 or end > len(data) or values.size != math.prod(shape):
        raise ValueError(f"{values.size} numbers at {begin} to {end} of {len(data)} bytes for the shape {shape}")
    return values.reshape(shape)
