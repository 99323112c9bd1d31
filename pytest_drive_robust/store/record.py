"""One finished episode as bytes: the reply of a worker process and the content of a file of the store.

::

    8 bytes    b"DREPISO" and the format version
    32 bytes   sha256 of all bytes after it
    4 bytes    length of the header, little endian
    header     JSON: the facts of the result (see `episode_fields`), the shape and the length of each table, notes
    tables     the trace, speed ratios, inference times and given observations (see `packing`); tracks (`track_bytes`)

The format holds no pickle, because the bytes may come from a process that an agent has corrupted.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.episode_fields import facts_of, plain, result_of
from pytest_drive_robust.store.packing import StoredGiven, StoredTrace, pack, unpack
from pytest_drive_robust.store.track_bytes import StoredTracks, pack_tracks

FORMAT_VERSION = 1
"""The version of the format, part of every key. Increase it when the meaning of the bytes changes."""

_MAGIC = b"DREPISO"
_SUM_BYTES = 32
_LENGTH = struct.Struct("<I")
_START = len(_MAGIC) + 1 + _SUM_BYTES


class CorruptRecordError(ValueError):
    """The bytes are no whole record: cut off, overwritten, or no record at all."""


class OtherFormatError(CorruptRecordError):
    """The record has another format version than `FORMAT_VERSION`."""


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """An episode result with notes, such as the name of the run that drove the episode."""

    result: EpisodeResult
    notes: Mapping[str, str] = field(default_factory=dict)


def encode_episode(result: EpisodeResult, notes: Mapping[str, str] | None = None) -> bytes:
    """Return the bytes of a finished episode. Equal results with equal notes give equal bytes."""
    tables: dict[str, NDArray[Any]] = {
        "trace": np.asarray(result.trace.rows, dtype="<f8"),
        "speed_ratios_pct": np.asarray(result.speed_ratios_pct, dtype="<f8").reshape(-1, 1),
        "inference_s": np.asarray(result.inference_s, dtype="<f8").reshape(-1, 1),
    }
    if result.given is not None:
        tables["given"] = np.asarray(result.given.rows, dtype="<f4")
    packed = {name: pack(rows) for name, rows in tables.items()}
    if result.tracks is not None:
        packed["tracks"] = pack_tracks(result.tracks)
        tables["tracks"] = np.zeros((len(packed["tracks"]), 1), np.uint8)
    header = {
        "episode": plain(result.episode),
        **{name: value for name, value in facts_of(result).items() if name not in tables},
        "notes": dict(notes or {}),
        "tables": [[name, rows.dtype.str, *rows.shape, len(packed[name])] for name, rows in tables.items()],
    }
    text = json.dumps(header, separators=(",", ":")).encode("ascii")
    body = b"".join((_LENGTH.pack(len(text)), text, *packed.values()))
    return b"".join((_MAGIC, bytes((FORMAT_VERSION,)), hashlib.sha256(body).digest(), body))


def decode_episode(data: bytes) -> EpisodeResult:
    """Return the episode result that `encode_episode` wrote, bit for bit; the trace is unpacked at its first read.

    Raises `CorruptRecordError` for other bytes, `OtherFormatError` for a record of another format version.
    """
    return decode_record(data).result


def decode_record(data: bytes, *, key: str | None = None) -> EpisodeRecord:
    """Return the result with its notes; raises as `decode_episode` does.

    Also raises `CorruptRecordError` when `key` is given and the notes hold another key.
    """
    _check(data)
    try:
        record = _decoded(data)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, struct.error) as error:
        raise CorruptRecordError(f"no episode is in it: {type(error).__name__}: {error}") from error
    if key is not None and record.notes.get("key") != key:
        raise CorruptRecordError(f"it is the record of {record.notes.get('key')!r}")
    return record


def _check(data: bytes) -> None:
    if data[: len(_MAGIC)] != _MAGIC:
        raise CorruptRecordError("it does not begin as a stored episode does" if data else "it is empty")
    if len(data) < _START + _LENGTH.size:
        raise CorruptRecordError(f"it is cut off after {len(data)} bytes")
    if hashlib.sha256(memoryview(data)[_START:]).digest() != data[_START - _SUM_BYTES : _START]:
        raise CorruptRecordError("its checksum does not fit: it was cut off or overwritten")
    if data[len(_MAGIC)] != FORMAT_VERSION:
        raise OtherFormatError(f"it has episode format {data[len(_MAGIC)]}, this version reads {FORMAT_VERSION}")


def _decoded(data: bytes) -> EpisodeRecord:
    (length,) = _LENGTH.unpack_from(data, _START)
    place = _START + _LENGTH.size + length
    header: dict[str, Any] = json.loads(data[_START + _LENGTH.size : place])
    pieces: dict[str, tuple[bytes, str, tuple[int, int]]] = {}
    for name, dtype, ticks, width, size in header["tables"]:
        pieces[name] = (data[place : place + size], dtype, (ticks, width))
        place += size

    def numbers(name: str) -> tuple[float, ...]:
        packed, dtype, shape = pieces[name]
        return tuple(unpack(packed, dtype=dtype, shape=shape)[:, 0].tolist())

    trace, _, (ticks, _) = pieces["trace"]
    given, tracks = pieces.get("given"), pieces.get("tracks")
    result = result_of(
        {**header["episode"], **header},
        trace=StoredTrace(packed=trace, ticks=ticks, digest=header["trace_digest"]),
        given=None if given is None else StoredGiven(packed=given[0], shape=given[2]),
        tracks=None if tracks is None else StoredTracks(tracks[0]),
        speed_ratios_pct=numbers("speed_ratios_pct"),
        inference_s=numbers("inference_s"),
    )
    return EpisodeRecord(result, header["notes"])
