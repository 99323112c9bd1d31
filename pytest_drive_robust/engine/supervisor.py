"""Our side's watch over one worker process: whatever happens to it, an episode has a result."""

from __future__ import annotations

import os
import pickle
import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.death import Blame, Death, Explanation, explain
from pytest_drive_robust.engine.exchange import Exchange
from pytest_drive_robust.engine.fork_server import ForkServer, NoWorkerError, Stopped
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.messages import DRIVE, SALVAGE, TOKEN_BYTES, Answer, Message, PickledRequest
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.rescore import RecordedControls, bare_result
from pytest_drive_robust.runner.executors import DRIVEN_AGAIN

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.worker_process import WorkerProcess
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["FailedAttempt", "Stopped", "Supervisor"]

_SALVAGE_S = 600.0


class FailedAttempt(NamedTuple):
    """An attempt whose worker died, with what the shared state still told of its episode."""

    explanation: Explanation
    recorded: RecordedControls | None = None


class Supervisor:
    """One worker process at a time, kept warm from episode to episode. `drive` is called from one thread at a time."""

    _kind = DRIVE

    def __init__(self, fork_server: ForkServer, limits: Limits) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._worker: WorkerProcess | None = None
        self._first_rss = 0
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self.output = ""

    @property
    def ticks(self) -> int:
        """Ticks of the episode under way, from any thread; 0 when there is none."""
        with self._lock:
            return 0 if self._worker is None else self._worker.state.ticks

    @property
    def pid(self) -> int | None:
        """The worker process, while there is one."""
        worker = self._worker
        return None if worker is None else worker.pid

    def drive(self, request: EpisodeRequest, *, count: int = 0) -> EpisodeResult:
        """Drive the episode, whatever happens to the process that drives it. It was tried `count` times before.

        Raises `UsageError` when the agent or the simulator cannot be made at all or the request cannot be sent, and
        `Stopped` after `stop`. `output` is then the end of what was printed.
        """
        started = time.monotonic()
        pickled = PickledRequest.of(request)
        payload = self._payload(pickled)
        while True:
            ended = self._attempt(self._kind, payload, self._limits)
            if isinstance(ended, FailedAttempt):
                result = self._result_of(ended, pickled, final=count == DRIVEN_AGAIN, started=started)
            else:
                result = self._judged(ended)
                if result.outcome is Outcome.INFRA_ERROR and count < DRIVEN_AGAIN:
                    result = None
            if result is not None:
                return result
            count += 1

    def _payload(self, request: PickledRequest) -> bytes:
        return pickle.dumps((request,))

    def stop(self) -> None:
        """Kill the worker and make `drive` raise `Stopped`, now and ever after. From any thread."""
        self._stopped.set()
        with self._lock:
            if self._worker is not None:
                self._worker.kill()

    def close(self) -> None:
        """End the worker. Calling it twice does no harm; afterwards `drive` raises `Stopped`."""
        self._stopped.set()
        self._end_worker()

    def _result_of(
        self, failure: FailedAttempt, request: PickledRequest, *, final: bool, started: float
    ) -> EpisodeResult | None:
        """Return the result of an episode that ended with its process; None when it should be driven again."""
        found = failure.explanation
        if found.blame is not Blame.AGENT and not final:
            return None
        if found.blame is Blame.OURS:
            outcome, result = Outcome.INFRA_ERROR, None
        else:
            outcome, result = Outcome.AGENT_ERROR, self._salvaged(failure, request)
        if result is None:
            result = bare_result(request.route, request.episode, outcome=outcome, end=found.end, detail=found.detail)
        detail = found.detail if found.blame is not Blame.OUTSIDE else f"{found.detail}, {DRIVEN_AGAIN + 1} times"
        return replace(result, outcome=outcome, end=found.end, end_detail=detail, wall_s=time.monotonic() - started)

    def _salvaged(self, failure: FailedAttempt, request: PickledRequest) -> EpisodeResult | None:
        """Score the episode up to where the agent was lost, in another worker; None when not even that works."""
        if failure.recorded is None:
            return None
        limits = replace(self._limits, act_s=None, episode_s=self._limits.episode_s or _SALVAGE_S)
        try:
            ended = self._attempt(SALVAGE, pickle.dumps((request, failure.recorded)), limits)
        except UsageError:
            return None
        return None if isinstance(ended, FailedAttempt) or ended.outcome is Outcome.INFRA_ERROR else ended

    def _judged(self, result: EpisodeResult) -> EpisodeResult:
        """Tell a crash for lack of memory from others: another limit gives another result."""
        limit = self._limits.memory_bytes
        if limit is None or result.end is not End.AGENT_CRASHED or "MemoryError" not in result.end_detail:
            return result
        detail = f"{result.end_detail}; its process may allocate {limit / 1e6:.0f} MB"
        return replace(result, end=End.AGENT_CRASHED_HARD, end_detail=detail)

    def _attempt(self, kind: bytes, payload: bytes, limits: Limits) -> EpisodeResult | FailedAttempt:
        """Make one request to the worker, a new one where there is none. Raises `UsageError`, `Stopped`."""
        try:
            worker = self._ready_worker()
        except NoWorkerError as error:
            return FailedAttempt(Explanation(Blame.OURS, End.SIMULATION_CRASHED, str(error)))
        exchange = Exchange(worker, limits)
        ended = exchange.ask(Message(kind, os.urandom(TOKEN_BYTES), payload))
        if kind != SALVAGE:
            self.output = exchange.printed
        self._check_stopped()
        if isinstance(ended, Death):
            failure = _failure(ended, worker.state)
            self._end_worker()
            return failure
        if self._is_spent(ended):
            self._end_worker()
        if isinstance(ended.result, UsageError):
            raise ended.result
        return ended.result

    def _ready_worker(self) -> WorkerProcess:
        """Return the worker that waits, or a new one. Raises `Stopped`, `NoWorkerError`, `UsageError`."""
        if self._worker is not None and self._worker.wait(0.0) is not None:  # somebody killed it while it waited
            self._end_worker()
        if self._worker is None:
            worker = self._fork_server.start_worker(self._limits, self._stopped.is_set)
            with self._lock:
                self._worker, self._first_rss = worker, 0
        self._check_stopped()  # `stop` may have come before there was a worker to kill
        return self._worker

    def _check_stopped(self) -> None:
        """Raise `Stopped` after `stop`: what ended since is no result."""
        if self._stopped.is_set():
            self._end_worker()
            raise Stopped

    def _is_spent(self, answer: Answer) -> bool:
        """Return whether the worker is not as it was before the episode, or its world broke."""
        self._first_rss = self._first_rss or answer.rss
        grew = answer.rss - self._first_rss > self._limits.growth_bytes
        broke = not isinstance(answer.result, UsageError) and answer.result.outcome is Outcome.INFRA_ERROR
        return grew or broke or bool(answer.leftovers)

    def _end_worker(self) -> None:
        with self._lock:
            worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()


def _failure(death: Death, state: SharedState) -> FailedAttempt:
    """Join a death with what the shared state still tells, unless the worker wrote all over it."""
    found, phase = explain(death), death.reading.phase
    try:
        rig, rows = state.rig(), state.rows()
    except (ValueError, KeyError, TypeError):
        return FailedAttempt(found)
    if phase is Phase.MAKE:
        return FailedAttempt(found)
    return FailedAttempt(found, RecordedControls(rig, rows, phase.call if rig is not None else "sensors"))
