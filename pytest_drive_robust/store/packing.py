"""Packs arrays into few bytes without loss: bytes sorted by significance, then zlib."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.result import Given, Trace, read_only

_LEVEL = 4
"""The zlib level. A trace of 600 ticks takes 1 to 2 ms; higher levels save a few percent for thrice the time."""


def pack(rows: NDArray[Any]) -> bytes:
    """Pack a table column by column: the first bytes of all ticks, then the second bytes, and so on.

    Neighbouring ticks differ only in their last bytes, so the first bytes compress to almost nothing.
    """
    columns = np.ascontiguousarray(rows.T)
    if columns.size == 0:
        return b""
    shuffled = columns.view(np.uint8).reshape(len(columns), -1, columns.itemsize).transpose(0, 2, 1)
    return zlib.compress(shuffled.tobytes(), _LEVEL)


def unpack(data: bytes, *, dtype: str, shape: tuple[int, int]) -> NDArray[Any]:
    """Return the read-only table that `pack` packed. Raises `ValueError` for bytes that do not hold such a table."""
    kind = np.dtype(dtype)
    ticks, width = shape
    try:
        raw = zlib.decompress(data) if data else b""
    except zlib.error as error:
        raise ValueError(f"a table does not unpack: {error}") from None
    shuffled = np.frombuffer(raw, dtype=np.uint8)
    if shuffled.size != ticks * width * kind.itemsize:
        raise ValueError(f"a table of {ticks} x {width} {dtype} has {shuffled.size} bytes")
    if shuffled.size == 0:
        return read_only(np.zeros(shape, dtype=kind))
    columns = np.ascontiguousarray(shuffled.reshape(width, kind.itemsize, ticks).transpose(0, 2, 1))
    return read_only(np.ascontiguousarray(columns.view(kind).reshape(width, ticks).T))


def unpack_columns(
    data: bytes, wanted: Sequence[int], *, dtype: str, shape: tuple[int, int]
) -> tuple[NDArray[Any], ...]:
    """Return the `wanted` columns of a table, by number, without unpacking later columns. Raises as `unpack` does.

    The returned columns have the strides of the whole table, because the last bit of a sum may depend on strides.
    """
    kind = np.dtype(dtype)
    ticks, width = shape
    size, count = ticks * kind.itemsize, max(wanted) + 1
    try:
        raw = zlib.decompressobj().decompress(data, count * size) if data and size else b""
    except zlib.error as error:
        raise ValueError(f"a table does not unpack: {error}") from None
    if len(raw) != count * size:
        raise ValueError(f"{count} columns of {ticks} {dtype} have {len(raw)} bytes")
    table = np.empty(shape, dtype=kind)
    columns = np.frombuffer(raw, np.uint8).reshape(count, kind.itemsize, ticks)
    cells = table.view(np.uint8).reshape(ticks, width, kind.itemsize)
    for number in wanted:
        cells[:, number] = columns[number].T
    return tuple(read_only(table[:, number]) for number in wanted)


class StoredTrace(Trace):
    """A trace that stays packed until its `rows` are read. `digest` is known without unpacking."""

    __slots__ = ("_digest", "_packed", "_shape", "_unpacked")

    _digest: str
    _packed: bytes
    _shape: tuple[int, int]
    _unpacked: NDArray[np.float64] | None

    def __init__(
        self, rows: NDArray[np.float64] | None = None, *, packed: bytes = b"", ticks: int = 0, digest: str = ""
    ) -> None:
        put = object.__setattr__  # as a frozen dataclass does
        put(self, "_unpacked", rows)
        put(self, "_packed", packed)
        put(self, "_shape", (ticks, len(Trace.COLUMNS)))
        put(self, "_digest", digest)

    @property
    def rows(self) -> NDArray[np.float64]:
        """(ticks, 11) float64, as in `Trace`."""
        rows = self._unpacked
        if rows is None:
            rows = unpack(self._packed, dtype="<f8", shape=self._shape)
            object.__setattr__(self, "_unpacked", rows)
        return rows

    def columns(self, *names: str) -> tuple[NDArray[np.float64], ...]:
        """Return the columns as `Trace.columns` does, without unpacking the columns behind them."""
        if self._unpacked is not None:
            return super().columns(*names)
        return unpack_columns(self._packed, [*map(self.COLUMNS.index, names)], dtype="<f8", shape=self._shape)

    @property
    def digest(self) -> str:
        """Hex digest of the bytes of `rows`."""
        return self._digest or Trace(self.rows).digest

    def __reduce__(self) -> tuple[type[Trace], tuple[NDArray[np.float64]]]:
        """Pickle as an ordinary `Trace`, with the rows unpacked."""
        return Trace, (self.rows,)


class StoredGiven(Given):
    """A table of given observations that stays packed until its `rows` are read."""

    __slots__ = ("_packed", "_shape", "_unpacked")

    _packed: bytes
    _shape: tuple[int, int]
    _unpacked: NDArray[np.float32] | None

    def __init__(
        self, rows: NDArray[np.float32] | None = None, *, packed: bytes = b"", shape: tuple[int, int] = (0, 0)
    ) -> None:
        put = object.__setattr__
        put(self, "_unpacked", rows)
        put(self, "_packed", packed)
        put(self, "_shape", shape)

    @property
    def rows(self) -> NDArray[np.float32]:
        """(observations, 5 + cameras) float32, as in `Given`."""
        rows = self._unpacked
        if rows is None:
            rows = unpack(self._packed, dtype="<f4", shape=self._shape)
            object.__setattr__(self, "_unpacked", rows)
        return rows

    def __reduce__(self) -> tuple[type[Given], tuple[NDArray[np.float32]]]:
        """Pickle as an ordinary `Given`, with the rows unpacked."""
        return Given, (self.rows,)
