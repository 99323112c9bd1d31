"""The executor of one machine whose agents are driven in lockstep: a few threads, each with a child for a batch."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.lockstep.batches import Batches, Verdicts
from pytest_drive_robust.engine.lockstep.lockstep_guard import LockstepGuard
from pytest_drive_robust.engine.pool import ProcessExecutor

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["LockstepProcessExecutor"]


class LockstepProcessExecutor:
    """Drives `workers` batches of up to `width` episodes at a time (see `runner.executors.Executor`).

    Episodes of agents for which `shares(agent)` is false are driven one by one, each in the place of a batch. No
    process is started before the first episode.
    """

    def __init__(
        self,
        recipe: Callable[[], WorkerSetup],
        limits: Limits,
        *,
        workers: int,
        width: int,
        shares: Callable[[str], bool],
    ) -> None:
        self._recipe = recipe
        self._limits = limits
        self._workers = workers
        self._width = width
        self._shares = shares
        self._one_by_one = ProcessExecutor(recipe, limits, slots=workers)
        self._singles: set[Future[EpisodeResult]] = set()
        self._nursery: ForkServer | None = None
        self._verdicts = Verdicts()
        self._batches: list[Batches] = []
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="drive-robust-lockstep")
        self._closed = False

    @property
    def slots(self) -> int:
        """Episodes at this moment: one that is driven alone takes the place of a whole batch."""
        self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    def submit(self, task: EpisodeRequest) -> Future[EpisodeResult]:
        """Let an episode join the emptiest batch. Raises `UsageError` when no child could be made like this one."""
        if not self._shares(task.episode.agent):
            single = self._one_by_one.submit(task)
            self._singles.add(single)
            return single
        if not self._batches:
            self._nursery = ForkServer(self._recipe())
            for _ in range(self._workers):
                guard = LockstepGuard(self._nursery, self._limits, width=self._width)
                self._batches.append(Batches(guard, self._verdicts, self._pool, self._one_by_one.heard))
        return min(self._batches, key=len).add(task)

    def close(self, *, cancel: bool = False) -> None:
        """End the children. With `cancel`, those that drive are killed; without, they come to their end first."""
        if self._closed:
            return
        self._closed = True
        if cancel:
            for batches in self._batches:
                batches.guard.stop()
        self._one_by_one.close(cancel=cancel)
        self._pool.shutdown(wait=True, cancel_futures=cancel)
        for batches in self._batches:
            batches.close()
        if self._nursery is not None:
            self._nursery.close()

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """(episode, what it printed at its end) of the first episodes that broke since this was asked last."""
        return self._one_by_one.last_words()
