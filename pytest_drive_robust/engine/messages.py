"""Messages between us and a worker process: each goes as one message of a `multiprocessing.connection.Connection`.

What we send is pickled. What a worker sends is never unpickled: a record of the store, or JSON.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

from pytest_drive_robust import errors
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.episode.recorded_ticks import RecordedTicks
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.record import decode_episode, encode_episode

TOKEN_BYTES = 16
"""Length of a token. An answer repeats the token of its request."""
_LARGEST_BYTES = 1 << 28
"""Largest message. Text that an agent wrote to the connection reads as a larger length and is refused at once."""


@dataclass(frozen=True, slots=True)
class WorkerRequest:
    """A request to a worker: an `EpisodeRequest` whose setting is the sentence in `episode`.

    `width` is the number of episodes in a batch, None for an episode driven by `act`; `shares` says that other episodes
    share the batch. With `recorded` controls from another process, the worker scores the episode and no agent drives.
    """

    episode: Episode
    route: Route
    identity: str
    width: int | None = None
    shares: bool = False
    recorded: RecordedTicks | None = None

    @classmethod
    def of(cls, request: EpisodeRequest, *, width: int | None = None, shares: bool = False) -> WorkerRequest:
        """Return the worker request for an episode request."""
        return cls(request.episode, request.route, request.identity, width, shares)

    def read(self, registry: Registry) -> EpisodeRequest:
        """Return the episode request. Raises `UsageError` when this process lacks perturbations of the setting."""
        setting = None
        with suppress(errors.UsageError):
            setting = Setting.parse(self.episode.setting, registry.perturbations())
        if setting is None or str(setting) != self.episode.setting:
            raise errors.UsageError(
                f"the setting {self.episode.setting!r} cannot be sent to the process that drives the episode. Define "
                "its perturbations in a module that can be imported and register them in pytest_drive_robust_register, "
                "or give --drive-executor inline."
            )
        return EpisodeRequest(self.episode, self.route, setting, self.identity)


def answer_bytes(result: EpisodeResult | errors.UsageError, *, is_spent: bool) -> bytes:
    """Return the payload of a worker's answer: a result, or the error why the episode cannot be driven at all.

    `is_spent` says that the worker's process is not as before the episode (see `worker.process_state`), or that its
    world broke.
    """
    if isinstance(result, errors.UsageError):
        return bytes([is_spent, True]) + refusal_bytes(result)
    return bytes([is_spent, False]) + encode_episode(result)


def read_answer(payload: bytes) -> tuple[EpisodeResult | errors.UsageError, bool]:
    """Return a worker's answer and whether the worker is spent. Raises `ValueError` for a payload that is no answer."""
    is_spent, refused, body = payload[:1], payload[1:2], payload[2:]
    return refusal(body) if refused == b"\1" else decode_episode(body), is_spent == b"\1"


def receive(connection: Connection) -> tuple[bytes, bytes]:
    """Wait for a message; return its token and its payload.

    Raises `EOFError` when the other side closed the connection, `OSError` or `ValueError` for anything but a message.
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
    return json.dumps([type(error).__name__, str(error)]).encode()


def refusal(content: bytes) -> errors.UsageError:
    """Return the usage error of another process, of the same class. Raises `ValueError` when `content` is none."""
    try:
        name, text = json.loads(content)
    except TypeError as error:
        raise ValueError(f"no refusal: {error}") from error
    kind = getattr(errors, str(name), errors.UsageError)
    known = isinstance(kind, type) and issubclass(kind, errors.UsageError)
    return kind(str(text)) if known else errors.UsageError(str(text))
