"""Packs tracks into few bytes: differences along each track, zigzag, bytes sorted by significance, then zlib.

::

    7 x 4 bytes   version, ticks between samples, then the rows of actors, motion, lights, plans and points
    4 bytes       the columns of lights
    tables        actors, motion, lights, plans, points: column by column, of each number its lowest byte first

The result is one zlib stream of little endian numbers, which a browser can unpack
(`report/pages/static/episode_data.js`).
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.domain.result import Tracks, read_only

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]

VERSION = 1
_HEAD = struct.Struct("<8I")
_LEVEL = 3
_WIDTHS = (6, 4, 0, 4, 2)


def pack_tracks(tracks: Tracks) -> bytes:
    """Return the packed bytes of tracks; `StoredTracks` return their bytes unchanged."""
    if isinstance(tracks, StoredTracks):
        return tracks.packed
    counts = tracks.actors[:, 5]
    starts = _starts(counts)
    motion = differences(tracks.motion, starts)
    motion[:, :2] = differences(motion[:, :2], starts)
    plans = tracks.plans[:, 1:].sum(axis=1)
    tables = (
        tracks.actors,
        motion,
        differences(tracks.lights, [0]),
        differences(tracks.plans, [0]),
        differences(tracks.points, _starts(plans)),
    )
    head = _HEAD.pack(VERSION, tracks.every_ticks, *(len(table) for table in tables), tracks.lights.shape[1])
    return zlib.compress(b"".join((head, *map(int_planes, tables))), _LEVEL)


def unpack_tracks(data: bytes) -> Tracks:
    """Return the tracks that `pack_tracks` packed. Raises `ValueError` for other bytes."""
    try:
        raw = zlib.decompress(data)
        version, every_ticks, *lengths, lines = _HEAD.unpack_from(raw)
        if version != VERSION:
            raise ValueError(f"they have version {version}, this program reads {VERSION}")
        tables, place = [], _HEAD.size
        for length, width in zip(lengths, (*_WIDTHS[:2], lines, *_WIDTHS[3:]), strict=True):
            size = 4 * length * width
            tables.append(_from_planes(raw[place : place + size], (length, width)))
            place += size
    except (zlib.error, struct.error, ValueError) as error:
        raise ValueError(f"these are no tracks: {error}") from None
    actors, motion, lights, plans, points = tables
    counts = actors[:, 5]
    summed = _sums(motion, _starts(counts))
    summed[:, :2] = _sums(summed[:, :2], _starts(counts))
    plans = np.cumsum(plans, axis=0, dtype=np.int32)
    return Tracks(
        every_ticks=every_ticks,
        actors=read_only(actors),
        motion=read_only(summed),
        lights=read_only(np.cumsum(lights, axis=0, dtype=np.int32)),
        plans=read_only(plans),
        points=read_only(_sums(points, _starts(plans[:, 1:].sum(axis=1)))),
    )


class StoredTracks(Tracks):
    """Tracks that stay packed until one of their tables is read."""

    __slots__ = ("_unpacked", "packed")

    packed: bytes
    _unpacked: Tracks | None

    def __init__(self, packed: bytes) -> None:
        object.__setattr__(self, "packed", packed)
        object.__setattr__(self, "_unpacked", None)

    def __getattr__(self, name: str) -> object:
        """Unpack at the first read of a table: the slots of `Tracks` are empty until then."""
        if name not in Tracks.__slots__:
            raise AttributeError(name)
        if self._unpacked is None:
            object.__setattr__(self, "_unpacked", unpack_tracks(self.packed))
        return getattr(self._unpacked, name)

    def __reduce__(self) -> tuple[type[StoredTracks], tuple[bytes]]:
        """Pickle the packed bytes, because they are small."""
        return StoredTracks, (self.packed,)


def int_planes(table: Ints) -> bytes:
    """Return whole numbers as bytes: zigzag (0, -1, 1, -2, ...), column by column, the lowest bytes first."""
    columns = np.ascontiguousarray(table.T, dtype="<i4")
    zigzag = ((columns << 1) ^ (columns >> 31)).astype("<u4")
    return zigzag.view(np.uint8).reshape(len(columns), -1, 4).transpose(0, 2, 1).tobytes() if columns.size else b""


def differences(table: Ints, starts: NDArray[np.int64] | list[int]) -> Ints:
    """Return the difference of each row to the row before; the rows at `starts` stay unchanged."""
    changed = table.astype(np.int32)
    changed[1:] -= table[:-1]
    if len(table):
        changed[starts] = table[starts]
    return changed


def _starts(counts: Ints) -> NDArray[np.int64]:
    """Return the index of the first row of each track that has rows."""
    return (np.cumsum(counts) - counts)[counts > 0].astype(np.int64)


def _sums(table: Ints, starts: NDArray[np.int64]) -> Ints:
    summed = np.cumsum(table, axis=0, dtype=np.int64)
    if len(starts):
        lengths = np.diff(np.append(starts, len(table)))
        before = summed[starts] - table[starts]
        summed -= np.repeat(before, lengths, axis=0)
    return summed.astype(np.int32)


def _from_planes(data: bytes, shape: tuple[int, int]) -> Ints:
    length, width = shape
    if len(data) != 4 * length * width:
        raise ValueError(f"a table of {length} x {width} has {len(data)} bytes")
    if not length * width:
        return np.zeros(shape, np.int32)
    planes = np.frombuffer(data, np.uint8).reshape(width, 4, length).transpose(0, 2, 1)
    zigzag = np.ascontiguousarray(planes).view("<u4").reshape(width, length)
    return np.ascontiguousarray(((zigzag >> 1).astype(np.int32) ^ -(zigzag & 1).astype(np.int32)).T)
