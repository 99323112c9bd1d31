"""Weights that ship: safetensors in half precision, listed in a manifest, checked before anything is made of them.

The order of loading: the manifest's entry, the size, the SHA-256 of the bytes, the header's metadata against the entry,
the network from the entry's specification, every tensor by name and shape. Nothing in a weight file is code and nothing
in it decides what is built; a file that fails any step is refused with `UsageError`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
from torch import Tensor, nn

from drive_robust_agents._nets.blocks import channels_last, fold_batch_norm
from drive_robust_agents._nets.manifest import FORMAT_VERSION, MOST_BYTES, WeightsEntry, plain_spec, read_manifest
from pytest_drive_robust.errors import UsageError

__all__ = ["SHIPPED", "Build", "begin_with", "encode", "load", "locate", "verified_bytes"]

Build = Callable[..., nn.Module]
"""Makes a network of a plain specification and keyword options: `TcpNet.build`."""

SHIPPED = Path(__file__).parent.parent / "weights"
"""The folder of the weights that ship."""

_UNSTORED = "num_batches_tracked"
_PICKLES = (b"PK", *(bytes((0x80, protocol)) for protocol in range(2, 6)))
"""How `torch.save` and `pickle.dump` begin their files."""


def locate(name: str, weights: str | Path | None = None) -> tuple[Path, WeightsEntry]:
    """Return the file and the manifest entry of an agent: those that ship, or a file beside its `manifest.json`."""
    folder = SHIPPED if weights is None else Path(weights).absolute().parent
    entry = read_manifest(folder, name)
    path = folder / entry.file
    if weights is not None and path != Path(weights).absolute():
        raise UsageError(f"{folder / 'manifest.json'} lists {entry.file!r} for {name!r}, not {Path(weights).name!r}.")
    return path, entry


def verified_bytes(path: Path, entry: WeightsEntry) -> bytes:
    """Return the content of a weight file that is what the manifest says, to the byte. Raises `UsageError`."""
    try:
        size = path.stat().st_size
        if size > MOST_BYTES or size != entry.size_bytes:
            raise UsageError(
                f"{path} has {size} bytes, expected {entry.size_bytes} (at most {MOST_BYTES}): it is truncated or not "
                f"the file of {entry.label}. {_ADVICE}"
            )
        content = path.read_bytes()
    except OSError as error:
        raise UsageError(f"the weights {path} cannot be read: {error.strerror}. {_ADVICE}") from None
    digest = hashlib.sha256(content).hexdigest()
    if digest != entry.sha256:
        raise UsageError(f"{path} has SHA-256 {digest}, the manifest says {entry.sha256}: it was changed. {_ADVICE}")
    return content


def load(
    name: str, build: Build, *, weights: str | Path | None = None, **options: object
) -> tuple[nn.Module, WeightsEntry]:
    """Return the network of an agent, ready to infer: frozen, in evaluation mode, batch normalisation folded.

    Raises `UsageError` for everything that is not exactly what the manifest lists and the agent builds.
    """
    path, entry = locate(name, weights)
    tensors = _parsed(path, entry, verified_bytes(path, entry))
    net = _built(path, entry, build, options)
    _fill(net, tensors, path)
    net.requires_grad_(False).eval()
    return channels_last(fold_batch_norm(net)), entry


def begin_with(net: nn.Module, name: str, weights: str | Path) -> None:
    """Put published weights into a network that goes on learning. Raises `UsageError` as `load` does."""
    path, entry = locate(name, weights)
    _fill(net, _parsed(path, entry, verified_bytes(path, entry)), path)


def encode(net: nn.Module, spec: object) -> bytes:
    """Encode a weight file: every parameter and statistic in half precision, with the metadata to check."""
    state = {
        name: (value.half() if value.is_floating_point() else value).detach().cpu().contiguous()
        for name, value in net.state_dict().items()
        if not name.endswith(_UNSTORED)
    }
    wild = [name for name, value in state.items() if value.is_floating_point() and not bool(value.isfinite().all())]
    if wild:
        raise UsageError(f"these weights are no finite half-precision numbers: {', '.join(wild)}.")
    return _in_order(safetensors.torch.save(state, metadata=_metadata(type(net).__name__, plain_spec(spec))))


def _in_order(content: bytes) -> bytes:
    """Sort the header: safetensors writes metadata in random order, and digests would differ.

    A file is the header's length in 8 bytes, the header (JSON, padded to a multiple of 8), the tensors.
    """
    begin = 8 + int.from_bytes(content[:8], "little")
    header = json.dumps(json.loads(content[8:begin]), sort_keys=True, separators=(",", ":")).encode()
    header += b" " * (-len(header) % 8)
    return len(header).to_bytes(8, "little") + header + content[begin:]


_ADVICE = "Install drive-robust-agents again, or give weights of your own with their manifest.json beside them."


def _metadata(architecture: str, spec: Mapping[str, Any]) -> dict[str, str]:
    return {"arch": architecture, "spec": json.dumps(spec, sort_keys=True), "format_version": str(FORMAT_VERSION)}


def _parsed(path: Path, entry: WeightsEntry, content: bytes) -> dict[str, Tensor]:
    """Return the tensors of a file whose header says what the manifest says."""
    try:
        tensors: dict[str, Tensor] = safetensors.torch.load(content)
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
        given = header.get("__metadata__", {})
    except (safetensors.SafetensorError, ValueError) as error:
        kind = " It looks like a pickle, which we never open." if content[:2] in _PICKLES else ""
        raise UsageError(f"{path} is no safetensors file: {error}.{kind} {_ADVICE}") from None
    expected = _metadata(entry.architecture, entry.spec)
    wrong = [name for name, value in expected.items() if given.get(name) != value]
    if wrong:
        told = "; ".join(f"{name} is {given.get(name)!r}, the manifest says {expected[name]!r}" for name in wrong)
        raise UsageError(f"the header of {path} does not fit the manifest: {told}. {_ADVICE}")
    return tensors


def _built(path: Path, entry: WeightsEntry, build: Build, options: Mapping[str, object]) -> nn.Module:
    try:
        net = build(entry.spec, **options)
        made = type(net).__name__
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{path}: no {entry.architecture} can be built as {entry.label} specifies: {error}. {_ADVICE}"
        ) from error
    if made != entry.architecture:
        raise UsageError(f"{path} holds weights of {entry.architecture}, expected those of {made}. {_ADVICE}")
    return net


def _fill(net: nn.Module, tensors: Mapping[str, Tensor], path: Path) -> None:
    """Put every tensor into its place; none may be missing and none too many."""
    own = net.state_dict()
    expected = {name: tuple(value.shape) for name, value in own.items() if not name.endswith(_UNSTORED)}
    given = {name: tuple(value.shape) for name, value in tensors.items()}
    if given != expected:
        differ = sorted(name for name in {*given, *expected} if given.get(name) != expected.get(name))
        some = ", ".join(f"{name} {given.get(name)} instead of {expected.get(name)}" for name in differ[:3])
        raise UsageError(
            f"{path} does not hold the tensors of {type(net).__name__}: {len(differ)} differ ({some}). {_ADVICE}"
        )
    full = {name: tensors[name].to(value.dtype) if name in tensors else value for name, value in own.items()}
    net.load_state_dict(full, strict=True)
