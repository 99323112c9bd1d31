"""One finished episode as one file: a JSON header and numpy arrays, no pickle."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.reception import Reception, Touch
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Trace

__all__ = ["FORMAT_VERSION", "read_episode", "write_episode"]

FORMAT_VERSION = 1
"""Grows when the meaning of the file changes."""

_PLAIN = (
    "scenario",
    "end_detail",
    "route_completion_pct",
    "route_length_m",
    "ticks",
    "dt_s",
    "wall_s",
    "privileged",
    "junction_passed",
)


def write_episode(path: Path, result: EpisodeResult) -> None:
    """Write `result` so that `path` is either absent or whole, whenever the process dies."""
    header = json.dumps(_header(result)).encode()
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(
                file,
                header=np.frombuffer(header, dtype=np.uint8),
                trace=np.asarray(result.trace.rows, dtype=np.float64),
                speed_ratios_pct=np.asarray(result.speed_ratios_pct, dtype=np.float64),
                inference_s=np.asarray(result.inference_s, dtype=np.float64),
            )
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read_episode(path: Path) -> EpisodeResult:
    """The episode in `path`, bit for bit. Raises `ValueError` for a file of another format version."""
    with np.load(path, allow_pickle=False) as arrays:
        header: dict[str, Any] = json.loads(arrays["header"].tobytes())
        if header["format"] != FORMAT_VERSION:
            raise ValueError(f"{path} has episode format {header['format']!r}, this version reads {FORMAT_VERSION}.")
        return EpisodeResult(
            episode=Episode(**header["episode"]),
            outcome=Outcome(header["outcome"]),
            end=End(header["end"]),
            infractions=tuple(
                Infraction(**{**item, "kind": InfractionKind(item["kind"])}) for item in header["infractions"]
            ),
            schedule=tuple(Injection(**item) for item in header["schedule"]),
            versions=header["versions"],
            reception=_reception(header.get("reception")),
            trace=Trace(arrays["trace"]),
            speed_ratios_pct=tuple(arrays["speed_ratios_pct"].tolist()),
            inference_s=tuple(arrays["inference_s"].tolist()),
            **{name: header[name] for name in _PLAIN},
        )


def _reception(fields: dict[str, Any] | None) -> Reception | None:
    """None in files from before it was recorded, too."""
    if fields is None:
        return None
    touched = tuple(Touch(**item) for item in fields.pop("touched"))
    return Reception(touched=touched, **{name: _tuple(value) for name, value in fields.items()})


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _header(result: EpisodeResult) -> dict[str, object]:
    """Everything but the arrays, as plain JSON types."""
    return {
        "format": FORMAT_VERSION,
        "episode": _fields(result.episode),
        "outcome": result.outcome.value,
        "end": result.end.value,
        "infractions": [{**_fields(item), "kind": item.kind.value} for item in result.infractions],
        "schedule": [_fields(item) for item in result.schedule],
        "versions": dict(result.versions),
        "reception": None if result.reception is None else asdict(result.reception),
        **{name: _plain(getattr(result, name)) for name in _PLAIN},
    }


def _fields(value: Any) -> dict[str, object]:
    return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}


def _plain(value: Any) -> object:
    """Numpy scalars as Python numbers: simulators compute with numpy and JSON does not know it."""
    return value.item() if isinstance(value, np.generic) else value
