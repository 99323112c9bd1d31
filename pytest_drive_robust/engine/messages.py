"""Messages between us and a worker process: each goes as one message of a `multiprocessing.connection.Connection`.

What we send is pickled. What a worker sends is never unpickled: a record of the store, or JSON.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import NamedTuple

from pytest_drive_robust import errors
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.record import decode_episode

__all__ = [
    "ALONE",
    "CHECK",
    "DRIVE",
    "REFUSED",
    "RESULT",
    "SALVAGE",
    "TOGETHER",
    "TOKEN_BYTES",
    "Answer",
    "Message",
    "answer_bytes",
    "receive",
    "refusal",
    "refusal_bytes",
    "send",
]

DRIVE, SALVAGE, RESULT, REFUSED = b"D", b"S", b"R", b"U"
CHECK, ALONE, TOGETHER = b"C", b"A", b"T"
"""About lockstep: whether an agent may, an episode in a batch of its own, an episode that shares its batch."""
TOKEN_BYTES = 16
"""How long a token is."""
_LARGEST_BYTES = 1 << 28
"""Four characters of text, read as a length, are more: text that somebody else wrote is refused at once."""
_LENGTH = struct.Struct("<I")


class Message(NamedTuple):
    """One message. `kind` is a letter; an answer repeats the token of its request."""

    kind: bytes
    token: bytes
    payload: bytes


@dataclass(frozen=True, slots=True)
class Answer:
    """What a worker replied: a result, or why it cannot drive that at all.

    `rss` is its memory in bytes, `leftovers` is what the episode left in the process (see `worker.leftovers`).
    """

    result: EpisodeResult | None
    refused: Mapping[str, str]
    rss: int
    leftovers: tuple[str, ...]

    @classmethod
    def of(cls, message: Message) -> Answer:
        """Read an answer. Raises `ValueError` when it is none."""
        try:
            (length,) = _LENGTH.unpack_from(message.payload)
            notes = json.loads(message.payload[_LENGTH.size : _LENGTH.size + length])
            rss, leftovers = int(notes["rss"]), tuple(map(str, notes["leftovers"]))
            body = message.payload[_LENGTH.size + length :]
            if message.kind == RESULT:
                return cls(decode_episode(body), {}, rss, leftovers)
            refused = json.loads(body)
            return cls(None, {"type": str(refused["type"]), "text": str(refused["text"])}, rss, leftovers)
        except (struct.error, KeyError, TypeError) as error:
            raise ValueError(f"no answer: {error}") from error


def answer_bytes(body: bytes, *, rss: int, leftovers: Sequence[str]) -> bytes:
    """Return the payload of an answer; `Answer.of` reads it."""
    notes = json.dumps({"rss": rss, "leftovers": list(leftovers)}).encode()
    return _LENGTH.pack(len(notes)) + notes + body


def send(connection: Connection, message: Message) -> None:
    """Send a whole message. Raises `OSError` when the other side is gone."""
    connection.send_bytes(message.kind + message.token + message.payload)


def receive(connection: Connection) -> Message:
    """Wait for a message.

    Raises `EOFError` when the other side closed the connection, `OSError` or `ValueError` for what is no message.
    """
    try:
        data = connection.recv_bytes(_LARGEST_BYTES)
    except ConnectionError as error:
        raise EOFError from error
    if len(data) <= TOKEN_BYTES:
        raise ValueError(f"a message of {len(data)} bytes")
    return Message(data[:1], data[1 : 1 + TOKEN_BYTES], data[1 + TOKEN_BYTES :])


def refusal_bytes(error: errors.UsageError) -> bytes:
    """Return a usage error as JSON; `refusal` reads it."""
    return json.dumps({"type": type(error).__name__, "text": str(error)}).encode()


def refusal(told: Mapping[str, str]) -> errors.UsageError:
    """Return the usage error that another process ran into, of the same class."""
    kind = getattr(errors, told["type"], errors.UsageError)
    if not (isinstance(kind, type) and issubclass(kind, errors.UsageError)):
        kind = errors.UsageError
    return kind(told["text"])
