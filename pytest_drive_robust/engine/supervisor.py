"""Drives episodes in a child process that may break: whatever happens to it, an episode has a result."""

from __future__ import annotations

import os
import pickle
import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.death import Blame, Death, Explanation, explain
from pytest_drive_robust.engine.exchange import Answer, Exchange, Interrupted
from pytest_drive_robust.engine.fork_server import ForkServer, NoWorkerError, Stopped, refusal
from pytest_drive_robust.engine.frames import TOKEN_BYTES, Frame
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.pickled_request import PickledRequest
from pytest_drive_robust.engine.wire import DRIVE, SALVAGE
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.rescore import RecordedControls, bare_result
from pytest_drive_robust.runner.executors import DRIVEN_AGAIN

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.shared_state import SharedState
    from pytest_drive_robust.engine.worker_process import WorkerProcess
    from pytest_drive_robust.runner.episode.rescore import AgentRig
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["FailedAttempt", "Stopped", "Supervisor"]

_SALVAGE_S = 600.0
_FAREWELL_S = 0.5


class FailedAttempt(NamedTuple):
    """A death with what the board still told."""

    finding: Explanation
    rig: AgentRig | None
    rows: NDArray[np.float64] | None
    call: str


class Supervisor:
    """One child process at a time, kept warm from episode to episode. `drive` is called from one thread at a time."""

    _kind = DRIVE

    def __init__(self, fork_server: ForkServer, limits: Limits) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._child: WorkerProcess | None = None
        self._first_rss = 0
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._wake_r, self._wake_w = os.pipe()
        self._closed = False
        self.output = ""

    @property
    def ticks(self) -> int:
        """Ticks of the episode under way, from any thread; 0 when there is none."""
        with self._lock:
            return 0 if self._child is None else self._child.board.ticks

    @property
    def pid(self) -> int | None:
        """The child process, while there is one."""
        child = self._child
        return None if child is None else child.pid

    def drive(self, request: EpisodeRequest, *, count: int = 0) -> EpisodeResult:
        """The episode, whatever happens to the process that drives it. It was tried `count` times before.

        Raises `UsageError` when the agent or the simulator cannot be made at all or the request cannot be sent, and
        `Stopped` after `stop`. `output` is then the end of what was printed.
        """
        started = time.monotonic()
        order = PickledRequest.of(request)
        payload = self._request_for(order)
        while True:
            ended = self._attempt(self._kind, payload, self._limits)
            if isinstance(ended, FailedAttempt):
                result = self._result_of(ended, order, final=count == DRIVEN_AGAIN, started=started)
            else:
                result = self._judged(ended)
                if result.outcome is Outcome.INFRA_ERROR and count < DRIVEN_AGAIN:
                    self._retire()
                    result = None
            if result is not None:
                return result
            count += 1

    def _request_for(self, order: PickledRequest) -> bytes:
        return pickle.dumps((order,))

    def stop(self) -> None:
        """Kill the child and make `drive` raise `Stopped`, now and ever after. From any thread."""
        self._stopped.set()
        with self._lock:
            if self._closed:
                return
            os.write(self._wake_w, b"!")
            if self._child is not None:
                self._child.kill()

    def close(self) -> None:
        """End the child. Calling it twice does no harm; afterwards `drive` raises `Stopped`."""
        self._stopped.set()
        self._retire()
        with self._lock:
            if not self._closed:
                self._closed = True
                os.close(self._wake_r)
                os.close(self._wake_w)

    def _result_of(
        self, failure: FailedAttempt, order: PickledRequest, *, final: bool, started: float
    ) -> EpisodeResult | None:
        """The result of an episode that ended with its process; None when it should be driven again."""
        finding = failure.finding
        if finding.blame is not Blame.AGENT and not final:
            return None
        if finding.blame is Blame.OURS:
            outcome, result = Outcome.INFRA_ERROR, None
        else:
            outcome, result = Outcome.AGENT_ERROR, self._salvaged(failure, order)
        if result is None:
            result = bare_result(order.route, order.episode, outcome=outcome, end=finding.end, detail=finding.detail)
        detail = finding.detail if finding.blame is not Blame.OUTSIDE else f"{finding.detail}, {DRIVEN_AGAIN + 1} times"
        return replace(result, outcome=outcome, end=finding.end, end_detail=detail, wall_s=time.monotonic() - started)

    def _salvaged(self, failure: FailedAttempt, order: PickledRequest) -> EpisodeResult | None:
        """The score up to where the agent was lost, from another child; None when not even that works."""
        if failure.rows is None or failure.call == "its constructor":
            return None
        recorded = RecordedControls(failure.rig, failure.rows, failure.call if failure.rig is not None else "sensors")
        limits = replace(self._limits, act_s=None, episode_s=self._limits.episode_s or _SALVAGE_S)
        try:
            ended = self._attempt(SALVAGE, pickle.dumps((order, recorded)), limits)
        except UsageError:
            return None
        if isinstance(ended, FailedAttempt) or ended.outcome is Outcome.INFRA_ERROR:
            self._retire()
            return None
        return ended

    def _judged(self, result: EpisodeResult) -> EpisodeResult:
        """Memory that was refused is not the agent's fault for ever: another limit gives another result."""
        limit = self._limits.memory_bytes
        if limit is None or result.end is not End.AGENT_CRASHED or "MemoryError" not in result.end_detail:
            return result
        detail = f"{result.end_detail}; its process may allocate {limit / 1e6:.0f} MB"
        return replace(result, end=End.AGENT_CRASHED_HARD, end_detail=detail)

    def _attempt(self, kind: bytes, payload: bytes, limits: Limits) -> EpisodeResult | FailedAttempt:
        """One request to the child, a new one where there is none. Raises `UsageError`, `Stopped`."""
        try:
            child = self._ready_child()
        except NoWorkerError as error:
            return FailedAttempt(Explanation(Blame.OURS, End.SIMULATION_CRASHED, str(error)), None, None, "")
        talk = Exchange(child, limits, self._wake_r)
        try:
            ended = talk.run(Frame(kind, os.urandom(TOKEN_BYTES), payload))
        except Interrupted:
            ended = None
        if kind != SALVAGE:
            self.output = talk.said
        if ended is None or self._stopped.is_set():  # what ended while we were stopping is no result
            self._discard()
            raise Stopped
        if isinstance(ended, Death):
            failure = _failure(ended, child.board)
            self._discard()
            return failure
        self._keep_or_replace(ended)
        if ended.result is None:
            raise refusal(ended.refused)
        return ended.result

    def _ready_child(self) -> WorkerProcess:
        """The child that waits, or a new one. Raises `Stopped`, `NoWorkerError`, `UsageError`."""
        if self._stopped.is_set():
            raise Stopped
        if self._child is not None and self._child.wait(0.0) is not None:  # somebody killed it while it waited
            self._discard()
        if self._child is None:
            child = self._fork_server.child(self._limits, self._stopped.is_set)
            with self._lock:
                self._child, self._first_rss = child, 0
        return self._child

    def _keep_or_replace(self, answer: Answer) -> None:
        """A child that is not as it was before the episode does not drive the next one."""
        self._first_rss = self._first_rss or answer.rss
        if answer.leftovers:
            self._discard()
        elif answer.rss - self._first_rss > self._limits.growth_bytes:
            self._retire()

    def _retire(self) -> None:
        """Let the child end by itself: its simulator may have something to close."""
        with self._lock:
            child, self._child = self._child, None
        if child is not None:
            child.hang_up()
            if child.wait(_FAREWELL_S) is None:
                child.kill()
            child.close()

    def _discard(self) -> None:
        """Kill the child and everything in its group."""
        with self._lock:
            child, self._child = self._child, None
        if child is not None:
            child.kill()
            child.close()


def _failure(death: Death, board: SharedState) -> FailedAttempt:
    """The death and what the board still tells, unless the child wrote all over it."""
    finding, call = explain(death), death.moment.phase.call
    try:
        return FailedAttempt(finding, board.rig(), board.rows(), call)
    except (ValueError, KeyError, TypeError):
        return FailedAttempt(finding, None, None, call)
