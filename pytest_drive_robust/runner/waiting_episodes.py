"""The episodes that wait for a driver, and the rules by which drivers take them: one alone, or a batch of one agent."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.runner.plan import EpisodeRequest


@dataclass(eq=False)
class _Waiting:
    request: EpisodeRequest
    future: Future[EpisodeResult]
    together: int

    @property
    def agent(self) -> str:
        return self.request.episode.agent


@dataclass(eq=False)
class Batch:
    """Episodes of one agent that one driver has taken.

    `width` is the largest number at a time, None for one that is driven alone. `open` holds the futures of the episodes
    without a result yet, by key.
    """

    agent: str
    width: int | None
    open: dict[str, Future[EpisodeResult]] = field(default_factory=dict)


class WaitingEpisodes:
    """Hands waiting episodes to `drivers` threads, in batches of up to `width` where an agent `shares` batches."""

    def __init__(self, drivers: int, width: int, shares: Callable[[str], bool]) -> None:
        self._drivers = drivers
        self._width = width
        self._shares = shares
        self._lock = threading.Lock()
        self._waiting: list[_Waiting] = []
        self._alone: set[Future[EpisodeResult]] = set()
        self._batches: list[Batch] = []
        self._yielding: Batch | None = None

    @property
    def slots(self) -> int:
        """Return how many episodes fit; an episode that is driven alone takes the place of a batch."""
        with self._lock:
            return self._drivers * self._width - (self._width - 1) * self._count_alone()

    def together(self, agent: str) -> int:
        """Return the width of batches for an agent that shares them, else 1."""
        return self._width if self._width > 1 and self._shares(agent) else 1

    def add(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Let an episode wait; return the future of its result."""
        future: Future[EpisodeResult] = Future()
        together = self.together(request.episode.agent)
        with self._lock:
            if together < self._width:
                self._alone.add(future)
            self._waiting.append(_Waiting(request, future, together))
        return future

    def begin(self) -> Batch | None:
        """Return an empty batch for the agent of the next episode; None if no episode waits."""
        with self._lock:
            first = self._first()
            if first is None:
                return None
            batch = Batch(first.agent, first.together if first.together > 1 else None)
            if batch.width is not None:
                self._batches.append(batch)
            return batch

    def take(self, batch: Batch) -> EpisodeRequest | None:
        """Move the oldest waiting episode of its agent into a batch; None if there is none, or the batch is full."""
        with self._lock:
            if batch.width is not None and (self._yields(batch) or len(batch.open) >= self._share()):
                return None
            item = next((item for item in self._waiting if item.agent == batch.agent), None)
            if item is None:
                return None
            self._waiting.remove(item)
            batch.open[item.request.key] = item.future
            return item.request

    def fail(self, batch: Batch, error: Exception) -> None:
        """Set `error` on the episodes of a batch without a result and on all waiting episodes of its agent."""
        with self._lock:
            lost = [item.future for item in self._waiting if item.agent == batch.agent]
            self._waiting = [item for item in self._waiting if item.agent != batch.agent]
        for future in (*batch.open.values(), *lost):
            future.set_exception(error)
        batch.open.clear()

    def end(self, batch: Batch) -> None:
        """Remove a batch. Cancel what is open: a test was interrupted, as by a timeout, and later tests may retry."""
        for future in batch.open.values():
            future.cancel()
        with self._lock:
            self._batches = [other for other in self._batches if other is not batch]
            if self._yielding is batch:
                self._yielding = None

    def _count_alone(self) -> int:
        """Return how many episodes without a result are driven alone."""
        self._alone = {future for future in self._alone if not future.done()}
        return len(self._alone)

    def _first(self) -> _Waiting | None:
        """Return the next episode: one that is driven alone, because no batch grows while it waits, else the oldest."""
        alone = (item for item in self._waiting if item.future in self._alone)
        return next(alone, self._waiting[0] if self._waiting else None)

    def _yields(self, batch: Batch) -> bool:
        """Return whether a batch takes no more episodes, because an episode that cannot join waits for a driver.

        Only one batch at a time yields: otherwise a single such episode would empty every driver.
        """
        first = self._first()
        if first is None or first.agent == batch.agent:
            if self._yielding is batch:
                self._yielding = None
        elif self._yielding is None:
            self._yielding = batch
        return self._yielding is batch

    def _share(self) -> int:
        """Return how many episodes a batch may hold, so that none holds eight while other drivers have nothing."""
        unfinished = len(self._waiting) + sum(len(batch.open) for batch in self._batches)
        return -(-unfinished // max(1, self._drivers - self._count_alone()))
