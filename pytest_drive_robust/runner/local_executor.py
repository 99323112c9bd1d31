"""The executor of this machine: drivers, in this process or in worker processes, take the waiting episodes."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.executor import Driver, Executor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.waiting_episodes import Batch, WaitingEpisodes

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
        self._drivers: Sequence[Driver] = ()
        self._waiting = WaitingEpisodes(max(1, threads), width or 1, shares)
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="drive-robust") if threads else None
        self._idle: list[Driver] = []
        self.work = None if threads else self._work
        self._steps: Generator[None, None, None] = (None for _ in ())
        self._lock = threading.Lock()
        self._words: list[tuple[str, str]] = []

    @property
    def slots(self) -> int:
        """Return how many episodes fit; an episode that is driven alone takes the place of a batch."""
        return self._waiting.slots

    def together(self, agent: str) -> int:
        """Return the width of batches for an agent that shares them, else 1."""
        return self._waiting.together(agent)

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Queue an episode for the next free driver; return a future of its result. Raises `UsageError`.

        See `make_drivers` for the error.
        """
        if not self._drivers:
            self._drivers = self._make_drivers(request.episode.agent)
            self._idle += self._drivers
        future = self._waiting.add(request)
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
        while (batch := self._waiting.begin()) is not None:
            yield from self._drive_batch(driver, batch)

    def _drive_batch(self, driver: Driver, batch: Batch) -> Generator[None, None, None]:
        """Drive a batch to its end, and leave no future of it open."""
        try:
            yield from self._drive_episodes(driver, batch)
        except Exception as error:  # `UsageError`, `Stopped` or another
            self._waiting.fail(batch, error)
            yield
        finally:
            self._waiting.end(batch)

    def _drive_episodes(self, driver: Driver, batch: Batch) -> Generator[None, None, None]:
        """Drive an episode alone, or a batch at once and then alone what it left; yield after each ended episode."""
        take = partial(self._waiting.take, batch)
        alone: list[EpisodeRequest] = []
        if batch.width is None:
            alone += filter(None, [take()])
        else:
            for request, result in driver.drive_batch(batch.agent, take, batch.width):
                if result is None or (isinstance(result, EpisodeResult) and result.outcome is Outcome.INFRA_ERROR):
                    alone.append(request)
                else:
                    self._end(driver, batch.open.pop(request.key), result)
                    yield
        for request in alone:
            try:
                found: EpisodeResult | UsageError = driver.drive(request, batch.width)
            except UsageError as error:
                found = error
            self._end(driver, batch.open.pop(request.key), found)
            yield

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
