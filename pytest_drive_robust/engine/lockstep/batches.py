"""One thread that drives batch after batch in a child of its own; episodes join while there is room."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.lockstep.vetting import Vetting, refused

if TYPE_CHECKING:
    from pytest_drive_robust.engine.lockstep.lockstep_guard import LockstepGuard
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["Batches", "Verdicts"]


class Verdicts:
    """Which agents may be driven in lockstep, each asked once for all threads of a run."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[str, Vetting] = {}

    def may_share(self, agent: str, ask: Callable[[], Vetting]) -> bool:
        """False when nothing is known yet. Raises `UsageError` for an agent that is refused, and what `ask` does."""
        with self._lock:
            vetting = self._known.get(agent) or ask()
            if vetting.recorded:
                self._known[agent] = vetting
        if vetting.problem is not None:
            raise refused(agent, vetting.problem)
        return vetting.passed


class Batches:
    """The episodes of one child. `len` is how many of them have no result yet.

    `heard(result, output)` is told of every episode and what its process has printed.
    """

    def __init__(
        self,
        guard: LockstepGuard,
        verdicts: Verdicts,
        pool: Executor,
        heard: Callable[[EpisodeResult, str], object],
    ) -> None:
        self.guard = guard
        self._verdicts = verdicts
        self._pool = pool
        self._heard = heard
        self._lock = threading.Lock()
        self._waiting: list[EpisodeRequest] = []
        self._futures: dict[str, Future[EpisodeResult]] = {}
        self._serving = False
        self._news_r, self._news_w = os.pipe()
        os.set_blocking(self._news_w, False)

    def __len__(self) -> int:
        return len(self._futures)

    def add(self, task: EpisodeRequest) -> Future[EpisodeResult]:
        """One more, which joins the batch under way when it is of the same agent and there is room."""
        future: Future[EpisodeResult] = Future()
        with self._lock:
            self._futures[task.key] = future
            self._waiting.append(task)
            if not self._serving:
                self._serving = True
                self._pool.submit(self._serve)
        with contextlib.suppress(BlockingIOError):  # it is full of news
            os.write(self._news_w, b"n")
        return future

    def close(self) -> None:
        """End the child. Called once nothing is served any more."""
        self.guard.close()
        os.close(self._news_r)
        os.close(self._news_w)

    def _serve(self) -> None:
        """In the thread: until nothing waits."""
        while (task := self._next()) is not None:
            agent = task.episode.agent
            try:
                self._drive(task)
            except BaseException as error:  # UsageError and Stopped; whatever else it is, nobody may wait for ever
                self._fail(agent, error)

    def _drive(self, first: EpisodeRequest) -> None:
        agent, guard = first.episode.agent, self.guard
        if not self._verdicts.may_share(agent, lambda: guard.vet(first)):
            self._drive_alone(first)  # it breaks at once: the next one tells more of its agent
            return
        lost = guard.drive_together(first, lambda: self._take(agent), self._ended, news_fd=self._news_r)
        for task in lost:
            self._drive_alone(task)

    def _drive_alone(self, task: EpisodeRequest) -> None:
        try:
            result = self.guard.drive(task)
        except UsageError as error:
            self._ended(task, error)
        else:
            self._ended(task, result)

    def _ended(self, task: EpisodeRequest, result: EpisodeResult | UsageError) -> None:
        with self._lock:
            future = self._futures.pop(task.key)
        if isinstance(result, EpisodeResult):
            self._heard(result, self.guard.output)
            future.set_result(result)
        else:
            future.set_exception(result)

    def _next(self) -> EpisodeRequest | None:
        with self._lock:
            if self._waiting:
                return self._waiting.pop(0)
            self._serving = False
            return None

    def _take(self, agent: str) -> EpisodeRequest | None:
        """The first that waits and is of this agent."""
        with self._lock:
            for number, task in enumerate(self._waiting):
                if task.episode.agent == agent:
                    return self._waiting.pop(number)
        return None

    def _fail(self, agent: str, error: BaseException) -> None:
        """Whatever is known of this agent has no result."""
        with self._lock:
            waiting = {task.key for task in self._waiting if task.episode.agent != agent}
            self._waiting = [task for task in self._waiting if task.key in waiting]
            lost = [self._futures.pop(key) for key in tuple(self._futures) if key not in waiting]
        for future in lost:
            future.set_exception(error)
