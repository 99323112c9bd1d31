"""Sends requests to a worker process and receives answers, or notices the end of the process."""

from __future__ import annotations

import os
import pickle
import select
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import wait
from typing import Generic, TypeVar

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.awake_clock import LONGEST_WAIT_S, AwakeClock
from pytest_drive_robust.engine.death import Cause, Death, Explanation, explain
from pytest_drive_robust.engine.messages import TOKEN_BYTES, WorkerRequest, read_answer, receive
from pytest_drive_robust.engine.shared_state import StateReading
from pytest_drive_robust.engine.worker_process import WorkerProcess
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.errors import UsageError

_EXIT_S = 2.0
"""Seconds for a process to end after a signal or a lost connection; only a process that does not end takes them all."""
_POLL_S = 0.02
"""Seconds between two looks for another request."""
T = TypeVar("T")
Take = Callable[[], tuple[WorkerRequest, T] | None]
"""Returns the next request and its receiver, or None when there is no request now."""


class Exchange(Generic[T]):
    """Waits for one worker, within the limits, by a clock and descriptors that are out of the worker's reach.

    `failure` explains the end of the worker, also when the supervisor's `stop` killed the worker; None while the worker
    runs. A worker that `is_spent` gets no more requests. At most `most` requests are under way at a time.
    """

    def __init__(self, worker: WorkerProcess, limits: Limits, *, most: int) -> None:
        self._worker = worker
        self._limits = limits
        self._most = most
        self.failure: Explanation | None = None
        self.is_spent = False
        self._under_way: dict[bytes, tuple[float, T]] = {}  # by token: start time, receiver
        self._clock = AwakeClock()

    @property
    def _started_s(self) -> float:
        return min(since_s for since_s, _ in self._under_way.values())

    def run(self, take: Take[T]) -> Iterator[tuple[T, EpisodeResult | UsageError | None]]:
        """Send the requests that `take` returns, and yield (receiver, answer) for each.

        `take` is called repeatedly while a request is under way. After the worker's end (`failure`), each unanswered
        request yields (receiver, None). The time limit of an episode starts with its own request.
        """
        worker = self._worker
        worker.forget_output()
        while self._send(take):
            ready = wait([worker.sentinel, worker.connection], self._patience_s())
            answer = self._hear(ready)
            if answer is not None:
                yield answer
            if self._under_way and self.failure is None:
                self._check_limits()
        yield from ((whom, None) for _, whom in self._under_way.values())

    def _send(self, take: Take[T]) -> bool:
        """Send requests while there is room: the worker must not wait for us. Return False when none is open."""
        poller = select.poll()
        poller.register(self._worker.connection, select.POLLOUT)
        while self.failure is None and not self.is_spent:
            may_send = not self._under_way or (len(self._under_way) < self._most and poller.poll(0))
            taken = take() if may_send else None
            if taken is None:
                break
            request, whom = taken
            token = os.urandom(TOKEN_BYTES)
            self._under_way[token] = time.monotonic(), whom
            try:
                self._worker.connection.send_bytes(token + pickle.dumps(request))
            except OSError:
                self._lost(Cause.SILENT, grace_s=_EXIT_S)
        return self.failure is None and bool(self._under_way)

    def _hear(self, ready: Sequence[object]) -> tuple[T, EpisodeResult | UsageError] | None:
        """Return (receiver, answer) if an answer has come, else None; note the end of the worker."""
        worker = self._worker
        if worker.connection not in ready:
            if worker.sentinel in ready and not worker.connection.poll():
                self._lost(Cause.SILENT, grace_s=_EXIT_S)  # no last answer is waiting in the connection
            return None
        try:
            token, payload = receive(worker.connection)
            if token not in self._under_way:
                raise ValueError("an answer to another request")
            result, is_spent = read_answer(payload)
        except EOFError:
            self._lost(Cause.SILENT, grace_s=_EXIT_S)
        except OSError:
            self._lost(Cause.GARBAGE, grace_s=_EXIT_S)
        except ValueError:
            self._lost(Cause.GARBAGE)
        else:
            self.is_spent = self.is_spent or is_spent
            return self._under_way.pop(token)[1], result
        return None

    def _patience_s(self) -> float | None:
        """Return the seconds until a limit must be checked, None without limits. A later call has a later limit."""
        waits = [_POLL_S] if self._most > 1 else []
        if self._limits.episode_s is not None:
            waits.append(self._limits.episode_s - self._clock.since(self._started_s))
        if self._limits.act_s is not None:
            reading = self._worker.state.read()
            waits.append(self._limits.act_s - (self._clock.since(reading.since_s) if reading.phase.is_call else 0.0))
        return max(0.0, min(*waits, LONGEST_WAIT_S)) + 0.001 if waits else None

    def _check_limits(self) -> None:
        """Kill the worker when a call or an episode has passed its limit."""
        reading = self._worker.state.read()
        act_s, episode_s = self._limits.act_s, self._limits.episode_s
        if act_s is not None and reading.phase.is_call and self._clock.since(reading.since_s) > act_s:
            self._lost(Cause.ACT_DEADLINE, reading, limit_s=act_s)
        elif episode_s is not None and self._clock.since(self._started_s) > episode_s:
            self._lost(Cause.EPISODE_DEADLINE, reading, limit_s=episode_s)

    def _lost(
        self, cause: Cause, reading: StateReading | None = None, *, grace_s: float = 0.0, limit_s: float = 0.0
    ) -> None:
        """Set `failure` to the worker's end. A worker that does not end within `grace_s` is killed, for `cause`."""
        worker = self._worker
        status = worker.wait(grace_s) if grace_s else None
        reading = reading or worker.state.read()
        if status is None:
            if limit_s:  # on SIGABRT faulthandler prints the current line
                worker.kill(signal.SIGABRT)
                worker.wait(_EXIT_S)
            worker.kill()
            worker.wait(_EXIT_S)
        death = Death(
            cause=cause if status is None else Cause.DIED,
            reading=reading,
            status=status,
            limit_s=limit_s,
            lasted_s=self._clock.since(reading.since_s),
            elapsed_s=self._clock.since(self._started_s),
            printed=worker.printed(self._limits.output_bytes),
        )
        self.failure = replace(explain(death), recorded=worker.state.recorded())
