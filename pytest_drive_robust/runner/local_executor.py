"""The executor of this machine: drivers, here or in processes, take what waits."""

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
"""Characters of what a broken episode printed that are kept for people."""
_MOST_EPISODES = 5


class LocalExecutor(Executor):
    """Has drivers take what waits: an episode, or with a `width` a batch of up to so many of an agent that `shares`.

    With `threads` there are so many drivers, each in a thread of its own; without there is one, which works in `work`.
    `make_drivers(agent)` is called at the first episode, which is one of `agent`, and raises `UsageError` where no
    process could be made like this one.
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
        """Return how many episodes fit: one that is driven alone takes the place of a batch."""
        self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    def together(self, agent: str) -> int:
        """Return the width of batches for an agent that shares them, else 1."""
        return self._width if self._width > 1 and self._shares(agent) else 1

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Let the next free driver have an episode. Raises `UsageError` as `make_drivers`."""
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
        """Wait for what is under way, and free everything."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._steps.close()
        for driver in self._drivers:
            driver.close()

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, what it printed at its end) of the first episodes that broke since this was asked last."""
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
        """Drive what waits until nothing does; a step for every episode that has ended."""
        while (first := self._first()) is not None:
            taken: dict[str, Future[EpisodeResult]] = {}
            try:
                yield from self._drive_first(driver, first, taken)
            except Exception as error:  # `UsageError`, or stopped: whatever it is, nobody may wait for ever
                self._fail(first.episode.agent, taken, error)
                yield
            finally:
                for future in taken.values():  # a test was interrupted, as by a timeout: later ones may drive it anew
                    future.cancel()
                with self._lock:
                    self._batches = [batch for batch in self._batches if batch is not taken]
                    if self._yielding is taken:
                        self._yielding = None

    def _first(self) -> EpisodeRequest | None:
        """Return what is driven next: one that is driven alone, as no batch grows while it waits, else the oldest."""
        waiting = tuple(self._waiting)
        alone = (request for request, future in waiting if future in self._singles)
        return next(alone, waiting[0][0] if waiting else None)

    def _drive_first(
        self, driver: Driver, first: EpisodeRequest, taken: dict[str, Future[EpisodeResult]]
    ) -> Generator[None, None, None]:
        """Drive `first`, with others of its agent where it shares. `taken` are those without a result yet, by key."""
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
        """Return whether a batch takes no more, as an episode that cannot join waits for its driver to be free.

        One batch at a time does: with all of them a single such episode would empty every driver.
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
        """Give somebody who waits a result; keep what a broken episode printed, for people."""
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
        """End whatever is known of this agent without a result."""
        with self._lock:
            lost = [future for request, future in self._waiting if request.episode.agent == agent]
            self._waiting = [item for item in self._waiting if item[0].episode.agent != agent]
        for future in (*taken.values(), *lost):
            future.set_exception(error)
        taken.clear()
