"""The executor of this machine: drivers, in this process or in worker processes, take the waiting episodes."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.executor import Driver, Executor
from pytest_drive_robust.runner.plan import EpisodeRequest

_MOST_WORDS = 2000
"""How many characters of a broken episode's output are kept for reports."""
_MOST_EPISODES = 5


class LocalExecutor(Executor):
    """Lets drivers take waiting episodes: one, or a batch of up to `width` episodes of an agent that `shares`.

    With `threads` there are that many drivers, each in its own thread; without, one driver works in `work`.
    `make_drivers(agent)` is called at the first episode, which belongs to `agent`. It raises `UsageError` when no
    worker process like this process could be made.
    """

    def __init__(
        self,
        make_drivers: Callable[[str], Sequence[Driver]],
        *,
        threads: int = 0,
        width: int | None = None,
        shares: Callable[[str], bool] = lambda agent: False,
    ) -> None:
        self._make_drivers = make_drivers
        self._width = width or 1
        self._shares = shares
        self._workers = max(1, threads)
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="drive-robust") if threads else None
        self.work = None if threads else self._work
        self._singles: set[Future[EpisodeResult]] = set()
        self._drivers: Sequence[Driver] = ()
        self._steps: Generator[None, None, None] = (None for _ in ())
        self._lock = threading.Lock()
        self._idle: list[Driver] = []
        self._waiting: list[tuple[EpisodeRequest, Future[EpisodeResult]]] = []
        self._batches: list[dict[str, Future[EpisodeResult]]] = []
        self._yielding: dict[str, Future[EpisodeResult]] | None = None
        self._words: list[tuple[str, str]] = []

    @property
    def slots(self) -> int:
        """Return how many episodes fit; an episode that is driven alone takes the place of a batch."""
        self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    def together(self, agent: str) -> int:
        """Return the width of batches for an agent that shares them, else 1."""
        return self._width if self._width > 1 and self._shares(agent) else 1

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Queue an episode for the next free driver; return a future of its result. Raises `UsageError`.

        See `make_drivers` for the error.
        """
        if not self._drivers:
            self._drivers = self._make_drivers(request.episode.agent)
            self._idle += self._drivers
        future: Future[EpisodeResult] = Future()
        with self._lock:
            if self._width > 1 and self.together(request.episode.agent) == 1:
                self._singles.add(future)
            self._waiting.append((request, future))
        if self._pool is not None:
            self._pool.submit(self._drive_in_thread)
        return future

    def close(self) -> None:
        """Wait for the episodes under way, cancel waiting ones, and close the drivers."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._steps.close()
        for driver in self._drivers:
            driver.close()

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, end of its output) of the first episodes that broke since the last call."""
        with self._lock:
            words, self._words = tuple(self._words), []
        return words

    def _work(self) -> None:
        """Drive in the caller's thread until an episode has ended or none is left."""
        for _ in self._steps:
            return
        self._steps = self._drive(self._drivers[0]) if self._drivers else self._steps
        next(self._steps, None)

    def _drive_in_thread(self) -> None:
        driver = self._idle.pop()  # there are as many as threads
        deque(self._drive(driver), maxlen=0)
        self._idle.append(driver)

    def _drive(self, driver: Driver) -> Generator[None, None, None]:
        """Drive waiting episodes until none waits; yield after each episode that has ended."""
        while (first := self._first()) is not None:
            taken: dict[str, Future[EpisodeResult]] = {}
            try:
                yield from self._drive_first(driver, first, taken)
            except Exception as error:  # `UsageError`, `Stopped` or another: no future may stay open
                self._fail(first.episode.agent, taken, error)
                yield
            finally:
                for future in taken.values():  # a test was interrupted, as by a timeout: later tests may retry
                    future.cancel()
                with self._lock:
                    self._batches = [batch for batch in self._batches if batch is not taken]
                    if self._yielding is taken:
                        self._yielding = None

    def _first(self) -> EpisodeRequest | None:
        """Return the next episode: one that is driven alone, because no batch grows while it waits, else the oldest."""
        waiting = tuple(self._waiting)
        alone = (request for request, future in waiting if future in self._singles)
        return next(alone, waiting[0][0] if waiting else None)

    def _drive_first(
        self, driver: Driver, first: EpisodeRequest, taken: dict[str, Future[EpisodeResult]]
    ) -> Generator[None, None, None]:
        """Drive `first`, in a batch with other episodes of its agent if the agent shares batches.

        Yields after each ended episode. `taken` holds the futures of the episodes without a result yet, by key.
        """
        agent = first.episode.agent
        width = self._width if self.together(agent) > 1 else None
        if width is not None:
            with self._lock:
                self._batches.append(taken)

        def take() -> EpisodeRequest | None:
            with self._lock:
                if width is not None and (self._yields(agent, taken) or len(taken) >= self._share()):
                    return None
                for number, (request, future) in enumerate(self._waiting):
                    if request.episode.agent == agent:
                        taken[request.key] = future
                        del self._waiting[number]
                        return request
            return None

        alone: list[EpisodeRequest] = []
        for request, result in () if width is None else driver.drive_batch(agent, take, width):
            if result is None or (isinstance(result, EpisodeResult) and result.outcome is Outcome.INFRA_ERROR):
                alone.append(request)
            else:
                self._end(driver, taken.pop(request.key), result)
                yield
        if width is None and (single := take()) is not None:
            alone.append(single)
        for request in alone:
            try:
                found: EpisodeResult | UsageError = driver.drive(request, width)
            except UsageError as error:
                found = error
            self._end(driver, taken.pop(request.key), found)
            yield

    def _yields(self, agent: str, taken: dict[str, Future[EpisodeResult]]) -> bool:
        """Return whether a batch takes no more episodes, because an episode that cannot join waits for a driver.

        Only one batch at a time yields: otherwise a single such episode would empty every driver.
        """
        first = self._first()
        if first is None or first.episode.agent == agent:
            if self._yielding is taken:
                self._yielding = None
        elif self._yielding is None:
            self._yielding = taken
        return self._yielding is taken

    def _share(self) -> int:
        """Return how many episodes a batch may hold, so that none holds eight while other drivers have nothing."""
        alone = sum(not future.done() for future in self._singles)
        unfinished = len(self._waiting) + sum(map(len, self._batches))
        return -(-unfinished // max(1, self._workers - alone))

    def _end(self, driver: Driver, future: Future[EpisodeResult], result: EpisodeResult | UsageError) -> None:
        """Set the result of a future; keep the output of a broken episode for reports."""
        if isinstance(result, UsageError):
            future.set_exception(result)
            return
        printed = driver.output.strip()
        if printed and result.outcome in (Outcome.AGENT_ERROR, Outcome.INFRA_ERROR):
            shown = printed if len(printed) <= _MOST_WORDS else f"...{printed[-_MOST_WORDS:]}"
            with self._lock:
                if len(self._words) < _MOST_EPISODES:
                    self._words.append((str(result.episode), shown))
        future.set_result(result)

    def _fail(self, agent: str, taken: dict[str, Future[EpisodeResult]], error: Exception) -> None:
        """Set `error` on the taken futures and on all waiting episodes of this agent."""
        with self._lock:
            lost = [future for request, future in self._waiting if request.episode.agent == agent]
            self._waiting = [item for item in self._waiting if item[0].episode.agent != agent]
        for future in (*taken.values(), *lost):
            future.set_exception(error)
        taken.clear()
