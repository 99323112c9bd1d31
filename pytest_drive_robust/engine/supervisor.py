"""Watches one worker process from our side: an episode has a result, whatever happens to the process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.death import Blame, Explanation
from pytest_drive_robust.engine.exchange import Exchange, T, Take
from pytest_drive_robust.engine.fork_server import ForkServer, NoWorkerError, Stopped
from pytest_drive_robust.engine.messages import WorkerRequest
from pytest_drive_robust.engine.worker_process import WorkerProcess
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.driver import DRIVEN_AGAIN
from pytest_drive_robust.runner.episode.bare_result import bare_result
from pytest_drive_robust.runner.episode.recorded_ticks import RecordedTicks
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.reuse import NO_MEMORY, RAN_OUT, ran_out

_Ended = Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]
_SALVAGE_S = 600.0


class Supervisor:
    """Drives in one worker process at a time, kept from episode to episode (see `runner.executor.Driver`).

    A supervisor is used from one thread at a time. An episode in a batch lasts as long as the whole batch, so its time
    limit is `width` times the limit of an episode. A call of `act_batch` has the time limit of any other call.
    """

    def __init__(self, fork_server: ForkServer, limits: Limits) -> None:
        self._fork_server = fork_server
        self._limits = limits
        self._worker: WorkerProcess | None = None
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._failure: Explanation  # explains the latest lost worker
        self._was_new = True  # whether the latest request went to a new worker
        self.output = ""  # the end of the worker's output at the latest result

    @property
    def ticks(self) -> int:
        """The number of ticks of the episode under way, 0 when there is none. Safe from any thread."""
        with self._lock:
            return 0 if self._worker is None else self._worker.state.ticks

    @property
    def pid(self) -> int | None:
        """The process id of the worker; None while there is none."""
        worker = self._worker
        return None if worker is None else worker.pid

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive the episode and return its result, whatever happens to the worker; with `width`, in its own batch."""
        return self.drive_request(WorkerRequest.of(request, width=width))

    def drive_request(self, request: WorkerRequest) -> EpisodeResult:
        """Drive the episode of a worker request, as `drive` does; another machine may have made the request.

        Raises `UsageError` when the agent or the simulator cannot be made at all, and `Stopped` after `stop`.
        """
        started = time.monotonic()
        for final in (*(False,) * DRIVEN_AGAIN, True):
            ended = self._attempt(request)
            if isinstance(ended, Explanation):
                result = self._result_of(ended, request, final=final, started=started)
            else:
                result = self._judged(ended)
            if result is not None and (final or result.outcome is not Outcome.INFRA_ERROR):
                return result
        raise AssertionError("the last attempt has a result")

    def drive_batch(self, agent: str, take: Callable[[], EpisodeRequest | None], width: int) -> _Ended:
        """Drive the episodes that `take` returns, up to `width` at a time; yield (request, result) for each.

        The result is None for an episode that ran out of memory, files or threads, and for episodes whose process
        broke, which come last. Raises `Stopped`.
        """

        def take_next() -> tuple[WorkerRequest, EpisodeRequest] | None:
            request = take()
            return None if request is None else (WorkerRequest.of(request, width=width, shares=True), request)

        for request, result in self._results(agent, take_next, self._limits_of(width), most=width):
            if _wants_room(result):
                yield request, None
            else:
                yield request, self._judged(result) if isinstance(result, EpisodeResult) else result

    def stop(self) -> None:
        """Kill the worker and make `drive` raise `Stopped` from now on. Safe from any thread."""
        self._stopped.set()
        with self._lock:
            if self._worker is not None:
                self._worker.kill()

    def close(self) -> None:
        """End the worker; afterwards `drive` raises `Stopped`. A second call does nothing."""
        self._stopped.set()
        self._end_worker()

    def _result_of(
        self, found: Explanation, request: WorkerRequest, *, final: bool, started: float
    ) -> EpisodeResult | None:
        """Return the result of an episode that ended with its process; None when it should be driven again."""
        if found.blame is not Blame.AGENT and not final:
            return None
        if found.blame is Blame.OURS:
            outcome, result = Outcome.INFRA_ERROR, None
        else:
            outcome, result = Outcome.AGENT_ERROR, self._salvaged(found.recorded, request)
        if result is None:
            result = bare_result(request.route, request.episode, outcome=outcome, end=found.end, detail=found.detail)
        detail = found.detail if found.blame is not Blame.OUTSIDE else f"{found.detail}, {DRIVEN_AGAIN + 1} times"
        return replace(result, outcome=outcome, end=found.end, end_detail=detail, wall_s=time.monotonic() - started)

    def _salvaged(self, recorded: RecordedTicks | None, request: WorkerRequest) -> EpisodeResult | None:
        """Return the result of the ticks before the agent was lost, scored in another worker; None if that fails."""
        if recorded is None:
            return None
        limits = replace(self._limits, act_s=None, episode_s=self._limits_of(request.width).episode_s or _SALVAGE_S)
        output = self.output
        try:
            ended = self._attempt(replace(request, recorded=recorded), limits)
        except UsageError:
            return None
        finally:
            self.output = output
        if isinstance(ended, Explanation) or ended.outcome is Outcome.INFRA_ERROR:
            return None
        mode = {} if request.width is None else {"lockstep": str(request.width)}
        return replace(ended, versions={**ended.versions, **mode})

    def _judged(self, result: EpisodeResult) -> EpisodeResult:
        """Return the result; mark a crash for lack of memory as hard, because another limit gives another result."""
        limit = self._limits.memory_bytes
        if limit is None or result.end is not End.AGENT_CRASHED:
            return result
        if not any(words in result.end_detail for words in NO_MEMORY):
            return result
        detail = f"{result.end_detail}; its process may allocate {limit / 1e6:.0f} MB"
        return replace(result, end=End.AGENT_CRASHED_HARD, end_detail=detail)

    def _limits_of(self, width: int | None) -> Limits:
        limits = self._limits
        return limits if limits.episode_s is None else replace(limits, episode_s=limits.episode_s * (width or 1))

    def _attempt(self, asked: WorkerRequest, limits: Limits | None = None) -> EpisodeResult | Explanation:
        """Send one request and return its result, or the explanation of a lost worker.

        Sends the request again to a new worker when the old one ran out of memory, files or threads, which earlier
        agents may hold there. Raises `UsageError`, `Stopped`.
        """
        limits = limits or self._limits_of(asked.width)
        while _wants_room(result := self._answer(asked, limits)):
            self._end_worker()
            if self._was_new:
                break
        if isinstance(result, UsageError):
            raise result
        return result or self._failure

    def _answer(self, asked: WorkerRequest, limits: Limits) -> EpisodeResult | UsageError | None:
        """Return the worker's answer to one request; None when the worker was lost. Raises `Stopped`."""
        waiting = iter([(asked, None)])
        ((_, result),) = self._results(asked.episode.agent, lambda: next(waiting, None), limits)
        return result

    def _results(
        self, agent: str, take: Take[T], limits: Limits, *, most: int = 1
    ) -> Iterator[tuple[T, EpisodeResult | UsageError | None]]:
        """Yield (receiver, answer) for the requests that `take` returns, from a worker that can drive the agent.

        Unanswered requests come last, with None; `_failure` then explains the lost worker. See `Exchange.run`. Raises
        `UsageError`, `Stopped`.
        """
        try:
            worker = self._ready_worker(agent)
        except NoWorkerError as error:
            self._failure = Explanation(Blame.OURS, End.SIMULATION_CRASHED, str(error))
            while (taken := take()) is not None:
                yield taken[1], None
            return
        exchange: Exchange[T] = Exchange(worker, limits, most=most)
        for whom, result in exchange.run(take):
            self._check_stopped()
            self.output = worker.printed(limits.output_bytes)
            if exchange.failure is not None:
                self._failure = exchange.failure
            yield whom, result
        if exchange.failure is not None or exchange.is_spent:
            self._end_worker()

    def _ready_worker(self, agent: str) -> WorkerProcess:
        """Return the waiting worker if it can drive the agent, else a new one.

        Raises `Stopped`, `NoWorkerError`, `UsageError`.
        """
        worker = self._worker
        if worker is not None and (worker.wait(0.0) is not None or agent not in (worker.drives or (agent,))):
            self._end_worker()  # the waiting worker was killed, or has not loaded the agent's kernels
        self._was_new = self._worker is None
        if self._worker is None:
            worker = self._fork_server.start_worker(self._limits, agent, self._stopped.is_set)
            with self._lock:
                self._worker = worker
        self._check_stopped()  # `stop` may have come before there was a worker to kill
        return self._worker

    def _check_stopped(self) -> None:
        """Raise `Stopped` after `stop`: an answer that came later is no result."""
        if self._stopped.is_set():
            self._end_worker()
            raise Stopped

    def _end_worker(self) -> None:
        with self._lock:
            worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()


def _wants_room(result: EpisodeResult | UsageError | None) -> bool:
    """Return whether the agent ran out of a resource that other agents may hold in its process, such as memory."""
    if isinstance(result, UsageError):
        return any(words in str(result) for words in RAN_OUT)
    return result is not None and ran_out(result)
