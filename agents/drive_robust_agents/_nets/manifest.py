"""The manifest beside weight files: for each file its network, its training data, and its driving score."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.store.whole_file import write_whole

__all__ = [
    "FORMAT_VERSION",
    "MANIFEST",
    "MOST_BYTES",
    "GraphFile",
    "WeightsEntry",
    "plain_spec",
    "read_manifest",
    "spec_from",
    "write_entry",
]

FORMAT_VERSION = 1
MANIFEST = "manifest.json"
MOST_BYTES = 6 * 1000 * 1000
"""Largest size of a weight file or graph; a larger file is not opened."""

_Spec = TypeVar("_Spec")


@dataclass(frozen=True, slots=True)
class GraphFile:
    """A graph for ONNX Runtime, a file in the manifest's folder, which uses the weights of the weight file."""

    file: str
    sha256: str
    size_bytes: int


@dataclass(frozen=True, slots=True)
class WeightsEntry:
    """The manifest's entry of one weight file.

    `file` lies in the manifest's folder. `architecture` is the class of the network and `spec` its specification in
    plain values. `graphs` has a graph for each method of the network that ONNX Runtime can run. `provenance` is the
    origin of the weights: rig, simulator version, data and its seed, trainer settings, closed-loop score with its
    interval.
    """

    name: str
    version: str
    file: str
    sha256: str
    size_bytes: int
    architecture: str
    spec: Mapping[str, Any]
    parameters: int
    format_version: int = FORMAT_VERSION
    graphs: Mapping[str, GraphFile] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """The label of the weights in results: `tcp@1.0:ab12cd34`."""
        return f"{self.name}@{self.version}:{self.sha256[:8]}"


def read_manifest(folder: Path, name: str) -> WeightsEntry:
    """Return the entry `name` of a folder's manifest. Raises `UsageError` when there is no usable entry."""
    path = folder / MANIFEST
    try:
        entries = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise UsageError(
            f"there is no {path}: train {name!r} and publish it, or install drive-robust-agents."
        ) from None
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} is no manifest: {error}.") from None
    if not isinstance(entries, dict):
        raise UsageError(f"{path} is no manifest: expected a table of entries by name.")
    if name not in entries:
        raise UnknownNameError.of(f"entry in {path}", name, entries)
    try:
        plain: dict[str, Any] = dict(entries[name])
        graphs = {method: GraphFile(**one) for method, one in plain.pop("graphs", {}).items()}
        entry = WeightsEntry(**plain, graphs=graphs)
    except (AttributeError, TypeError, ValueError) as error:
        raise UsageError(f"the entry {name!r} of {path} is not as expected: {error}.") from None
    files = (entry.file, *(graph.file for graph in entry.graphs.values()))
    elsewhere = [file for file in files if Path(file).name != file]
    if entry.format_version != FORMAT_VERSION or elsewhere:
        raise UsageError(
            f"the entry {name!r} of {path} names {(elsewhere or files)[0]!r} in format {entry.format_version!r}, "
            f"expected a file of that folder in format {FORMAT_VERSION}. Install a drive-robust-agents that fits it."
        )
    return entry


def write_entry(folder: Path, entry: WeightsEntry) -> None:
    """Write an entry to a folder's manifest; an entry of equal name is replaced."""
    path = folder / MANIFEST
    entries = json.loads(path.read_bytes()) if path.exists() else {}
    entries[entry.name] = dataclasses.asdict(entry)
    text = json.dumps(entries, indent=1, sort_keys=True) + "\n"
    write_whole(path, text)


def plain_spec(spec: object) -> dict[str, Any]:
    """Return a specification (a frozen dataclass of plain values) as a dictionary, as JSON would read it back."""
    if not dataclasses.is_dataclass(spec) or isinstance(spec, type):
        raise TypeError(f"expected a dataclass of plain values, got {spec!r}")
    plain: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(spec)))
    return plain


def spec_from(cls: type[_Spec], plain: Mapping[str, Any]) -> _Spec:
    """Build a specification from plain values; lists become tuples, also in nested specifications.

    Raises `TypeError` for unknown fields.
    """
    kinds = get_type_hints(cls)
    return cls(**{name: _frozen(kinds.get(name), value) for name, value in plain.items()})


def _frozen(kind: Any, value: Any) -> object:
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return spec_from(kind, value)
    return tuple(_frozen(None, item) for item in value) if isinstance(value, list) else value
