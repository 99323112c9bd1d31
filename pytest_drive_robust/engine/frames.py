"""Messages over a stream: a magic word, a token that the answer must repeat, a kind, and a length before the bytes."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import NamedTuple

__all__ = ["TOKEN_BYTES", "BrokenStreamError", "Frame", "FrameReader", "packed", "read_frame", "write_frame"]

_HEAD = struct.Struct("<4s16scQ")
_MAGIC = b"pdr1"
_LARGEST_BYTES = 1 << 31
_CHUNK_BYTES = 1 << 16
TOKEN_BYTES = 16
"""How long a token is."""


class BrokenStreamError(Exception):
    """What arrived is no message: the stream ended within one, or somebody else wrote to it."""


class Frame(NamedTuple):
    """One message. `kind` is a letter."""

    kind: bytes
    token: bytes
    payload: bytes


def packed(frame: Frame) -> bytes:
    """A whole message as it goes over the stream."""
    return _HEAD.pack(_MAGIC, frame.token, frame.kind, len(frame.payload)) + frame.payload


def write_frame(fd: int, frame: Frame) -> None:
    """Write a whole message. Raises `OSError` when the other side is gone."""
    rest = memoryview(packed(frame))
    while rest:
        rest = rest[os.write(fd, rest) :]


def read_frame(fd: int) -> Frame | None:
    """Wait for a message; None when the other side closed the stream. Raises `BrokenStreamError`, `OSError`."""
    head = _read_exactly(fd, _HEAD.size)
    if not head:
        return None
    token, kind, length = _parsed(head)
    return Frame(kind, token, _read_exactly(fd, length))


class FrameReader:
    """Collects what arrives piece by piece."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, piece: bytes) -> Iterator[Frame]:
        """The messages that are complete now. Raises `BrokenStreamError`."""
        self._data += piece
        while len(self._data) >= _HEAD.size:
            token, kind, length = _parsed(bytes(self._data[: _HEAD.size]))
            end = _HEAD.size + length
            if len(self._data) < end:
                return
            payload = bytes(self._data[_HEAD.size : end])
            del self._data[:end]
            yield Frame(kind, token, payload)


def _parsed(head: bytes) -> tuple[bytes, bytes, int]:
    magic, token, kind, length = _HEAD.unpack(head)
    if magic != _MAGIC or length > _LARGEST_BYTES:
        raise BrokenStreamError(f"a message begins with {head[:8]!r}")
    return token, kind, length


def _read_exactly(fd: int, size: int) -> bytes:
    """`size` bytes, or none at all when the stream ends before them."""
    data = bytearray()
    while len(data) < size:
        piece = os.read(fd, min(size - len(data), _CHUNK_BYTES))
        if not piece and not data:
            return b""
        if not piece:
            raise BrokenStreamError(f"the stream ended after {len(data)} of {size} bytes")
        data += piece
    return bytes(data)
