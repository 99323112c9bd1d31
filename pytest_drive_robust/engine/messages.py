"""Messages between us and a worker process: each goes as one message of a `multiprocessing.connection.Connection`.

What we send is pickled. What a worker sends is never unpickled: a record of the store, or JSON.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, NamedTuple

from pytest_drive_robust import errors
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.store.record import decode_episode, encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest

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
    "PickledRequest",
    "answer_message",
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


class Message(NamedTuple):
    """One message. `kind` is a letter; an answer repeats the token of its request."""

    kind: bytes
    token: bytes
    payload: bytes


@dataclass(frozen=True, slots=True)
class PickledRequest:
    """An episode with its route. `setting` is pickled; None where it does not pickle, and its sentence must do."""

    episode: Episode
    route: Route
    setting: bytes | None

    @classmethod
    def of(cls, request: EpisodeRequest) -> PickledRequest:
        """Pickle what a worker needs of a request."""
        try:
            setting: bytes | None = pickle.dumps(request.setting)
        except Exception:  # a class of a conftest.py that another one pushed out of sys.modules, a lambda, a lock ...
            setting = None
        return cls(request.episode, request.route, setting)

    def read_setting(self, registry: Registry) -> Setting:
        """Return the setting, in the worker. Raises `UsageError` when its classes are not to be had there."""
        problem = "its perturbations do not pickle"
        if self.setting is not None:
            try:
                found: Any = pickle.loads(self.setting)
                if isinstance(found, Setting):
                    return found
                problem = f"it came out as {found!r}"
            except Exception as error:
                problem = f"{type(error).__name__}: {error}"
        try:
            parsed = Setting.parse(self.episode.setting, registry.perturbations())
        except errors.UsageError:
            parsed = None
        if parsed is None or str(parsed) != self.episode.setting:
            raise errors.UsageError(
                f"the setting {self.episode.setting!r} cannot be sent to the process that drives the episode "
                f"({problem}). Define its perturbations in a module that can be imported and register them in "
                "pytest_drive_robust_register, or give --drive-executor inline."
            )
        return parsed


@dataclass(frozen=True, slots=True)
class Answer:
    """What a worker replied: a result, or why it cannot drive that at all.

    `rss` is its memory in bytes, `leftovers` is what the episode left in the process (see `worker.process_state`).
    """

    result: EpisodeResult | errors.UsageError
    rss: int
    leftovers: tuple[str, ...]

    @classmethod
    def of(cls, message: Message) -> Answer:
        """Read an answer. Raises `ValueError` when it is none."""
        line, _, body = message.payload.partition(b"\n")
        try:
            notes = json.loads(line)
            result = decode_episode(body) if message.kind == RESULT else refusal(body)
            return cls(result, int(notes["rss"]), tuple(map(str, notes["leftovers"])))
        except (KeyError, TypeError) as error:
            raise ValueError(f"no answer: {error}") from error


def answer_message(
    token: bytes, result: EpisodeResult | errors.UsageError, *, rss: int, leftovers: Sequence[str]
) -> Message:
    """Return an answer to the request with this token; `Answer.of` reads it."""
    notes = json.dumps({"rss": rss, "leftovers": list(leftovers)}).encode() + b"\n"
    if isinstance(result, errors.UsageError):
        return Message(REFUSED, token, notes + refusal_bytes(result))
    return Message(RESULT, token, notes + encode_episode(result))


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


def refusal(content: bytes) -> errors.UsageError:
    """Return the usage error that another process ran into, of the same class. Raises `ValueError`, `KeyError`."""
    told = json.loads(content)
    kind = getattr(errors, str(told["type"]), errors.UsageError)
    if not (isinstance(kind, type) and issubclass(kind, errors.UsageError)):
        kind = errors.UsageError
    return kind(str(told["text"]))
