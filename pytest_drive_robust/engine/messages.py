"""Messages between us and a worker process: each goes as one message of a `multiprocessing.connection.Connection`.

What we send is pickled. What a worker sends is never unpickled: a record of the store, or JSON.
"""

from __future__ import annotations

import json
import pickle
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from pytest_drive_robust import errors
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.record import decode_episode, encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.episode.rescore import RecordedControls

__all__ = [
    "CHECK",
    "DRIVE",
    "SALVAGE",
    "TOKEN_BYTES",
    "Answer",
    "WorkerRequest",
    "receive",
    "refusal",
    "refusal_bytes",
    "send",
]

DRIVE, CHECK, SALVAGE = "drive", "check", "salvage"
"""What a worker is asked for: an episode, whether its agent may be driven in lockstep, the score of a recorded one."""
TOKEN_BYTES = 16
"""How long a token is: an answer repeats that of its request."""
_LARGEST_BYTES = 1 << 28
"""Four characters of text, read as a length, are more: text that somebody else wrote is refused at once."""


@dataclass(frozen=True, slots=True)
class WorkerRequest:
    """What a worker is asked for, pickled as the payload of a message: an `EpisodeRequest` that any process can read.

    `setting` is pickled; None where it does not pickle, and its sentence must do. `width` is that of the batch, None
    for an episode that is driven by `act`; `recorded` is what `SALVAGE` is about.
    """

    episode: Episode
    route: Route
    setting: bytes | None
    identity: str
    kind: str = DRIVE
    width: int | None = None
    recorded: RecordedControls | None = None

    @classmethod
    def of(cls, request: EpisodeRequest, *, kind: str = DRIVE, width: int | None = None) -> WorkerRequest:
        """Pickle what a worker needs of a request."""
        try:
            setting: bytes | None = pickle.dumps(request.setting)
        except Exception:  # a class of a conftest.py that another one pushed out of sys.modules, a lambda, a lock ...
            setting = None
        return cls(request.episode, request.route, setting, request.identity, kind, width)

    def read(self, registry: Registry) -> EpisodeRequest:
        """Return the episode request. Raises `UsageError` when the classes of its setting are not to be had here."""
        return EpisodeRequest(self.episode, self.route, self._read_setting(registry), self.identity)

    def _read_setting(self, registry: Registry) -> Setting:
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

    `is_spent`: its process is not as it was before the episode (see `worker.process_state`), or its world broke.
    """

    result: EpisodeResult | errors.UsageError
    is_spent: bool

    def to_bytes(self) -> bytes:
        """Return the answer as the payload of a message; `from_bytes` reads it."""
        refused = isinstance(self.result, errors.UsageError)
        notes = json.dumps({"is_spent": self.is_spent, "refused": refused}).encode()
        body = refusal_bytes(self.result) if isinstance(self.result, errors.UsageError) else encode_episode(self.result)
        return notes + b"\n" + body

    @classmethod
    def from_bytes(cls, payload: bytes) -> Answer:
        """Read an answer. Raises `ValueError` when it is none."""
        line, _, body = payload.partition(b"\n")
        try:
            notes = json.loads(line)
            result = refusal(body) if notes["refused"] else decode_episode(body)
            return cls(result, bool(notes["is_spent"]))
        except (KeyError, TypeError) as error:
            raise ValueError(f"no answer: {error}") from error


def send(connection: Connection, token: bytes, payload: bytes) -> None:
    """Send a whole message. Raises `OSError` when the other side is gone."""
    connection.send_bytes(token + payload)


def receive(connection: Connection) -> tuple[bytes, bytes]:
    """Wait for a message; return its token and its payload.

    Raises `EOFError` when the other side closed the connection, `OSError` or `ValueError` for what is no message.
    """
    try:
        data = connection.recv_bytes(_LARGEST_BYTES)
    except ConnectionError as error:
        raise EOFError from error
    if len(data) < TOKEN_BYTES:
        raise ValueError(f"a message of {len(data)} bytes")
    return data[:TOKEN_BYTES], data[TOKEN_BYTES:]


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
