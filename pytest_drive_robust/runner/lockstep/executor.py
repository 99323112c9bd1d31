"""The executor of agents that are driven in lockstep, in this process or in others."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.lockstep.admission import Admissions

if TYPE_CHECKING:
    from pytest_drive_robust.runner.executors import Executor
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["BatchDriver", "LockstepExecutor"]


class BatchDriver(Protocol):
    """Drives one batch at a time, here (`runner.lockstep.lockstep`) or in a process (`engine.lockstep.supervisor`)."""

    output: str
    """What was printed by the time of the latest result."""

    def check(self, request: EpisodeRequest) -> bool:
        """May the agent of `request` be driven in lockstep? False: it broke before it could be asked.

        Raises `UsageError` when it must not, or cannot be made.
        """
        ...

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None]
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]:
        """Drive what `take` gives, each with its result as soon as it ends, until none is under way.

        `take` may give none now and another one later. No result (None): it wants to be driven alone.
        """
        ...

    def drive(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive one in a batch of its own, again when its end was not the agent's doing. Raises `UsageError`."""
        ...

    def wake(self) -> None:
        """Take again: there may be another request. From any thread."""
        ...

    def stop(self) -> None:
        """Cut off what is under way. From any thread."""
        ...

    def close(self) -> None:
        """Free worlds, agents and processes."""
        ...


class LockstepExecutor:
    """Drives a batch of up to `width` episodes on each driver (see `runner.executors.Executor`).

    Episodes of agents for which `shares(agent)` is false are driven by `one_by_one`, each in the place of a batch.
    `make_drivers` is called at the first episode of another agent. With `threads` each driver works in one of its own;
    without, there is one driver, which works in `work`.
    """

    def __init__(
        self,
        one_by_one: Executor,
        make_drivers: Callable[[], Sequence[BatchDriver]],
        *,
        width: int,
        shares: Callable[[str], bool],
        threads: int = 0,
        heard: Callable[[EpisodeResult, str], object] = lambda result, output: None,
    ) -> None:
        self._one_by_one = one_by_one
        self._make_drivers = make_drivers
        self._width = width
        self._shares = shares
        self._heard = heard
        self._workers = max(1, threads)
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="drive-robust-lockstep") if threads else None
        self.work = None if threads else self._work
        self._singles: set[Future[EpisodeResult]] = set()
        self._admissions = Admissions()
        self._queues: list[_Queue] = []
        self._closed = False

    @property
    def slots(self) -> int:
        """Episodes at this moment: one that is driven alone takes the place of a whole batch until it is collected."""
        if self._pool is not None:
            self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Let an episode join the emptiest batch. Raises `UsageError` when no process could be made like this one."""
        if not self._shares(request.episode.agent):
            single = self._one_by_one.submit(request)
            self._singles.add(single)
            return single
        if not self._queues:
            self._queues += [_Queue(driver, self._admissions, self._heard) for driver in self._make_drivers()]
        queue = min(self._queues, key=len)
        future, begins = queue.add(request)
        if begins and self._pool is not None:
            self._pool.submit(queue.drive_all)
        return future

    def close(self, *, cancel: bool = False) -> None:
        """Free everything. With `cancel` what is under way is cut off; without, it comes to its end first."""
        if self._closed:
            return
        self._closed = True
        if cancel:
            for queue in self._queues:
                queue.driver.stop()
        elif self._pool is None:
            for queue in self._queues:
                queue.drive_all()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=cancel)
        for queue in self._queues:
            queue.close()
        self._one_by_one.close(cancel=cancel)  # last: it may hold what the drivers' processes live in

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """(episode, what it printed at its end) of the first episodes that broke since this was asked last."""
        told: Callable[[], tuple[tuple[str, str], ...]] = getattr(self._one_by_one, "last_words", tuple)
        return told()

    def _work(self) -> None:
        """Drive in the caller's thread until an episode has ended."""
        self._singles.clear()
        for queue in self._queues:
            queue.drive_on()


class _Queue:
    """The episodes of one driver. `len` is how many of them have no result yet."""

    def __init__(
        self, driver: BatchDriver, admissions: Admissions, heard: Callable[[EpisodeResult, str], object]
    ) -> None:
        self.driver = driver
        self._admissions = admissions
        self._heard = heard
        self._lock = threading.Lock()
        self._waiting: list[EpisodeRequest] = []
        self._alone: list[EpisodeRequest] = []
        self._futures: dict[str, Future[EpisodeResult]] = {}
        self._busy = False
        self._steps: Generator[None, None, None] | None = None

    def __len__(self) -> int:
        return len(self._futures)

    def add(self, request: EpisodeRequest) -> tuple[Future[EpisodeResult], bool]:
        """One more, which joins the batch under way when it is of its agent; True when somebody must begin to drive."""
        future: Future[EpisodeResult] = Future()
        with self._lock:
            self._futures[request.key] = future
            self._waiting.append(request)
            begins, self._busy = not self._busy, True
        self.driver.wake()
        return future, begins

    def drive_on(self) -> None:
        """Drive until an episode has ended or none is left."""
        steps, self._steps = self._steps or self._drive(), None
        for _ in steps:
            self._steps = steps
            return

    def drive_all(self) -> None:
        """Drive until none is left."""
        deque(self._steps or self._drive(), maxlen=0)

    def close(self) -> None:
        """Forget what is under way, and free what drives it."""
        if self._steps is not None:
            self._steps.close()
        self.driver.close()

    def _drive(self) -> Generator[None, None, None]:
        """Batch after batch; a step for every episode that has ended."""
        while (agent := self._next_agent()) is not None:
            yield from self._drive_agent(agent)

    def _drive_agent(self, agent: str) -> Generator[None, None, None]:
        try:
            yield from self._drive_batch(agent)
        except Exception as error:  # `UsageError`, or stopped: whatever it is, nobody may wait for ever
            self._fail(agent, error)
            yield

    def _drive_batch(self, agent: str) -> Generator[None, None, None]:
        first = self._waiting[0]
        if not self._admissions.may_share(agent, lambda: self.driver.check(first)):
            self._alone += filter(None, [self._take(agent)])  # it breaks at once: the next one tells more of its agent
        for request, result in self.driver.drive_batch(agent, lambda: self._take(agent)) if not self._alone else ():
            if result is None or (isinstance(result, EpisodeResult) and result.outcome is Outcome.INFRA_ERROR):
                self._alone.append(request)
            else:
                self._end(request, result)
                yield
        while self._alone:
            request = self._alone.pop(0)
            try:
                self._end(request, self.driver.drive(request))
            except UsageError as error:
                self._end(request, error)
            yield

    def _take(self, agent: str) -> EpisodeRequest | None:
        """The first that waits and is of this agent; None while others are to be driven alone."""
        with self._lock:
            for number, request in enumerate(() if self._alone else self._waiting):
                if request.episode.agent == agent:
                    return self._waiting.pop(number)
        return None

    def _next_agent(self) -> str | None:
        with self._lock:
            self._busy = bool(self._waiting)
            return self._waiting[0].episode.agent if self._waiting else None

    def _end(self, request: EpisodeRequest, result: EpisodeResult | UsageError) -> None:
        with self._lock:
            future = self._futures.pop(request.key)
        if isinstance(result, EpisodeResult):
            self._heard(result, self.driver.output)
            future.set_result(result)
        else:
            future.set_exception(result)

    def _fail(self, agent: str, error: Exception) -> None:
        """Whatever is known of this agent has no result."""
        self._alone.clear()
        with self._lock:
            others = {request.key for request in self._waiting if request.episode.agent != agent}
            self._waiting[:] = [request for request in self._waiting if request.key in others]
            lost = [self._futures.pop(key) for key in tuple(self._futures) if key not in others]
        for future in lost:
            future.set_exception(error)
