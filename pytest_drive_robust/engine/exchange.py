"""Requests to a worker process and what comes back: answers, or the news of its death."""

from __future__ import annotations

import os
import select
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.engine.death import Cause, Death
from pytest_drive_robust.engine.messages import Answer, Message, receive

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.shared_state import StateReading
    from pytest_drive_robust.engine.worker_process import WorkerProcess

__all__ = ["Exchange", "Interrupted"]

_CHUNK_BYTES = 1 << 16
_TRACEBACK_S = 0.1
_EXIT_S = 0.25
_FULL_S = 0.05


class Interrupted(Exception):  # noqa: N818 - it is no error: somebody asked for it
    """The descriptor that wakes us became readable."""


class Exchange:
    """Waits for one worker, within the limits, by a clock and descriptors that are out of the worker's reach.

    `wake_fd` becomes readable when somebody wants to stop, `news_fd` when there may be another request.
    """

    def __init__(self, worker: WorkerProcess, limits: Limits, wake_fd: int, news_fd: int | None = None) -> None:
        self._worker = worker
        self._limits = limits
        self._wake_fd = wake_fd
        self._news_fd = news_fd
        self._printed = bytearray()
        self._started_s = 0.0
        self._begun_s: dict[bytes, float] = {}  # by token, of the requests under way
        self._is_full = False

    @property
    def printed(self) -> str:
        """The end of what was printed since the request."""
        return bytes(self._printed[-self._limits.output_bytes :]).decode("utf-8", "replace")

    def ask(self, request: Message) -> Answer | Death:
        """Send one request and wait. After a `Death` the worker is dead, too. Raises `Interrupted`."""
        requests, answers = [request], list[Answer]()
        death = self.run(lambda: requests.pop() if requests else None, lambda _, answer: answers.append(answer))
        return answers[0] if death is None else death

    def run(self, take: Callable[[], Message | None], hear: Callable[[bytes, Answer], object]) -> Death | None:
        """Send what `take` gives, give `hear` what comes back; None when nothing is under way and nothing to be sent.

        The limit of an episode counts from its own request. After a `Death` the worker is dead, too. Raises
        `Interrupted`.
        """
        worker = self._worker
        sources: list[Any] = [self._wake_fd, worker.output, worker.sentinel, worker.connection]
        if self._news_fd is not None:
            sources.append(self._news_fd)
        while True:
            death = self._send(take)
            if death is not None or not self._begun_s:
                return death
            self._started_s = min(self._begun_s.values())
            ready = wait(sources, self._patience_s())
            if self._wake_fd in ready:
                raise Interrupted
            if self._news_fd in ready:
                os.read(self._news_fd, _CHUNK_BYTES)
            if worker.output in ready and not self._listen():
                sources.remove(worker.output)
            death = self._hear(ready, hear) or (self._late() if self._begun_s else None)
            if death is not None:
                return death

    def _send(self, take: Callable[[], Message | None]) -> Death | None:
        """Send as much as there is room for: a worker that answers must never wait for us, who ask."""
        poller = select.poll()
        poller.register(self._worker.connection, select.POLLOUT)
        while True:
            self._is_full = bool(self._begun_s) and not poller.poll(0)
            request = None if self._is_full else take()
            if request is None:
                return None
            self._begun_s[request.token] = self._started_s = time.monotonic()
            try:
                self._worker.send(request)
            except OSError:
                return self._lost(Cause.SILENT)

    def _hear(self, ready: list[Any], hear: Callable[[bytes, Answer], object]) -> Death | None:
        """Pass one answer on, where one has come."""
        worker = self._worker
        if worker.connection not in ready:
            if worker.sentinel in ready and not worker.connection.poll():
                return self._lost(Cause.SILENT)  # without an answer that came in the last moment
            return None
        try:
            message = receive(worker.connection)
            if message.token not in self._begun_s:
                raise ValueError("an answer to another request")
            answer = Answer.of(message)
        except EOFError:
            return self._lost(Cause.SILENT)
        except (OSError, ValueError):
            return self._lost(Cause.GARBAGE)
        del self._begun_s[message.token]
        self._listen()
        hear(message.token, answer)
        return None

    def _listen(self) -> bool:
        """Keep what was printed. False when nothing more can come."""
        try:
            while piece := os.read(self._worker.output, _CHUNK_BYTES):
                self._printed += piece
                if len(self._printed) > 4 * self._limits.output_bytes + _CHUNK_BYTES:
                    del self._printed[: -self._limits.output_bytes]
                if len(piece) < _CHUNK_BYTES:
                    return True
        except BlockingIOError:
            return True
        return False

    def _patience_s(self) -> float | None:
        """Return until when nothing can become late. A call that begins after this is late after the next one."""
        now = time.monotonic()
        waits = [_FULL_S] if self._is_full else []
        if self._limits.episode_s is not None:
            waits.append(self._started_s + self._limits.episode_s - now)
        if self._limits.act_s is not None:
            reading = self._worker.state.read()
            begun_s = reading.since_s if reading.phase.is_call else now
            waits.append(begun_s + self._limits.act_s - now)
        return max(0.0, min(waits)) + 0.001 if waits else None

    def _late(self) -> Death | None:
        now = time.monotonic()
        reading = self._worker.state.read()
        act_s, episode_s = self._limits.act_s, self._limits.episode_s
        if act_s is not None and reading.phase.is_call and now - reading.since_s > act_s:
            return self._kill(Cause.ACT_DEADLINE, reading, act_s)
        if episode_s is not None and now - self._started_s > episode_s:
            return self._kill(Cause.EPISODE_DEADLINE, reading, episode_s)
        return None

    def _lost(self, cause: Cause) -> Death:
        """Tell how the worker ended; `cause` is why it can be of no use where it has not."""
        status = self._worker.wait(_EXIT_S)
        if status is None:
            return self._kill(cause, self._worker.state.read())
        return self._death(Cause.DIED, self._worker.state.read(), status=status)

    def _kill(self, cause: Cause, reading: StateReading, limit_s: float = 0.0) -> Death:
        """End the worker, with a chance for faulthandler to say where it is."""
        if limit_s:
            self._worker.kill(signal.SIGABRT)
            self._worker.wait(_TRACEBACK_S)
        self._worker.kill()
        self._worker.wait(_EXIT_S)
        return self._death(cause, reading, limit_s=limit_s)

    def _death(self, cause: Cause, reading: StateReading, *, status: int | None = None, limit_s: float = 0.0) -> Death:
        self._listen()
        now = time.monotonic()
        return Death(
            cause=cause,
            reading=reading,
            status=status,
            limit_s=limit_s,
            lasted_s=now - reading.since_s,
            elapsed_s=now - self._started_s,
            faults=os.pread(self._worker.faults, _CHUNK_BYTES, 0).decode("utf-8", "replace"),
            printed=self.printed,
        )
