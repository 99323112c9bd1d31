"""Requests to a worker process and what comes back: answers, or the news of its death."""

from __future__ import annotations

import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pytest_drive_robust.engine.death import Cause, Death
from pytest_drive_robust.engine.messages import TOKEN_BYTES, Answer, receive, send

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.shared_state import StateReading
    from pytest_drive_robust.engine.worker_process import WorkerProcess

__all__ = ["Exchange"]

_CHUNK_BYTES = 1 << 16
_EXIT_S = 2.0
"""How long a process may take to end, after it said where it is; only those take all of it that do not end at all."""
T = TypeVar("T")


class Exchange(Generic[T]):
    """Waits for one worker, within the limits, by a clock and descriptors that are out of the worker's reach.

    `death` is how the worker ended, once it has: also when somebody kills it who wants to stop. One that `is_spent` is
    given nothing more. `poll_s` is how often to ask whether there is another request, None when there is never one
    while another is under way.
    """

    def __init__(self, worker: WorkerProcess, limits: Limits, *, poll_s: float | None = None) -> None:
        self._worker = worker
        self._limits = limits
        self._poll_s = poll_s
        self.death: Death | None = None
        self.is_spent = False
        self._printed = bytearray()
        self._under_way: dict[bytes, tuple[float, T]] = {}  # by token: since when, and for whom

    @property
    def _started_s(self) -> float:
        return min(since_s for since_s, _ in self._under_way.values())

    @property
    def printed(self) -> str:
        """The end of what was printed since the request."""
        return bytes(self._printed[-self._limits.output_bytes :]).decode("utf-8", "replace")

    def run(self, take: Callable[[], tuple[bytes, T] | None]) -> Iterator[tuple[T, Answer]]:
        """Send what `take` gives, a payload and whom it is for, and yield each answer with whom it is for.

        `take` is asked again and again while something is under way. Ends when nothing is any more, and with `death`
        set when the worker is dead. The limit of an episode counts from its own request.
        """
        worker = self._worker
        sources: list[Any] = [worker.output, worker.sentinel, worker.connection]
        while self._send(take):
            ready = wait(sources, self._patience_s())
            if worker.output in ready and not self._listen():
                sources.remove(worker.output)
            answer = self._hear(ready)
            if answer is not None:
                yield answer
            if self._under_way and self.death is None:
                self._check_limits()

    def _send(self, take: Callable[[], tuple[bytes, T] | None]) -> bool:
        """Send as much as there is room for, since a worker that answers must never wait for us.

        False when there is nothing to wait for.
        """
        poller = select.poll()
        poller.register(self._worker.connection, select.POLLOUT)
        while self.death is None and not self.is_spent:
            taken = take() if not self._under_way or poller.poll(0) else None
            if taken is None:
                break
            payload, whom = taken
            token = os.urandom(TOKEN_BYTES)
            self._under_way[token] = time.monotonic(), whom
            try:
                send(self._worker.connection, token, payload)
            except OSError:
                self._lost(Cause.SILENT, grace_s=_EXIT_S)
        return self.death is None and bool(self._under_way)

    def _hear(self, ready: list[Any]) -> tuple[T, Answer] | None:
        """Return the answer that has come."""
        worker = self._worker
        if worker.connection not in ready:
            if worker.sentinel in ready and not worker.connection.poll():
                self._lost(Cause.SILENT, grace_s=_EXIT_S)  # without an answer that came in the last moment
            return None
        try:
            token, payload = receive(worker.connection)
            if token not in self._under_way:
                raise ValueError("an answer to another request")
            answer = Answer.from_bytes(payload)
        except EOFError:
            self._lost(Cause.SILENT, grace_s=_EXIT_S)
        except OSError:
            self._lost(Cause.GARBAGE, grace_s=_EXIT_S)
        except ValueError:
            self._lost(Cause.GARBAGE)
        else:
            self._listen()
            self.is_spent = self.is_spent or answer.is_spent
            return self._under_way.pop(token)[1], answer
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
        waits = [] if self._poll_s is None else [self._poll_s]
        if self._limits.episode_s is not None:
            waits.append(self._started_s + self._limits.episode_s - now)
        if self._limits.act_s is not None:
            reading = self._worker.state.read()
            begun_s = reading.since_s if reading.phase.is_call else now
            waits.append(begun_s + self._limits.act_s - now)
        return max(0.0, min(waits)) + 0.001 if waits else None

    def _check_limits(self) -> None:
        """Kill a worker that is late."""
        now = time.monotonic()
        reading = self._worker.state.read()
        act_s, episode_s = self._limits.act_s, self._limits.episode_s
        if act_s is not None and reading.phase.is_call and now - reading.since_s > act_s:
            self._lost(Cause.ACT_DEADLINE, reading, limit_s=act_s)
        elif episode_s is not None and now - self._started_s > episode_s:
            self._lost(Cause.EPISODE_DEADLINE, reading, limit_s=episode_s)

    def _lost(
        self, cause: Cause, reading: StateReading | None = None, *, grace_s: float = 0.0, limit_s: float = 0.0
    ) -> None:
        """Note how the worker ended. One that has not within `grace_s` is killed, for `cause`."""
        worker = self._worker
        status = worker.wait(grace_s) if grace_s else None
        reading = reading or worker.state.read()
        if status is None:
            if limit_s:  # faulthandler says where it is
                worker.kill(signal.SIGABRT)
                worker.wait(_EXIT_S)
            worker.kill()
            worker.wait(_EXIT_S)
        self._listen()
        now = time.monotonic()
        self.death = Death(
            cause=cause if status is None else Cause.DIED,
            reading=reading,
            status=status,
            limit_s=limit_s,
            lasted_s=now - reading.since_s,
            elapsed_s=now - self._started_s,
            faults=os.pread(worker.faults, _CHUNK_BYTES, 0).decode("utf-8", "replace"),
            printed=self.printed,
        )
