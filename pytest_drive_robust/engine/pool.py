"""The executor of one machine: a few threads, each with a worker process that a supervisor watches."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.runner.lockstep.executor import LockstepExecutor

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["ProcessExecutor", "lockstep_in_processes"]

_WORDS = 2000
"""Characters of what a broken episode printed that are kept for people."""
_MOST_EPISODES = 5


class ProcessExecutor:
    """Drives `slots` episodes at a time (see `runner.executors.Executor`).

    The threads only wait: what drives are their workers, which live until the run ends or an episode breaks them.
    No process is started, and `worker_setup` not called, before the first episode.
    """

    def __init__(self, worker_setup: Callable[[], WorkerSetup], limits: Limits, *, slots: int) -> None:
        self.slots = slots
        self._setup = worker_setup
        self._limits = limits
        self._fork_server: ForkServer | None = None
        self._own = threading.local()
        self._lock = threading.Lock()
        self._supervisors: list[Supervisor] = []
        self._closed = False
        self._words: list[tuple[str, str]] = []
        self._pool = ThreadPoolExecutor(slots, thread_name_prefix="drive-robust")

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Begin an episode in the next free worker. Raises `UsageError` where no worker could load what we have."""
        self.fork_server()
        return self._pool.submit(self._drive, request)

    def fork_server(self) -> ForkServer:
        """Return what the workers are forked from, for others that fork some, too. Raises `UsageError` as `submit`."""
        if self._fork_server is None:
            self._fork_server = ForkServer(self._setup())
        return self._fork_server

    @property
    def compiling(self) -> tuple[int, int]:
        """How many functions are compiled, of how many that the workers wait for."""
        return self._fork_server.compiling if self._fork_server is not None else (0, 0)

    def close(self, *, cancel: bool = False) -> None:
        """End the workers. With `cancel`, those that drive are killed; without, they come to their end first."""
        if self._closed:
            return
        self._closed = True
        if cancel:
            with self._lock:
                supervisors = tuple(self._supervisors)
            for supervisor in supervisors:
                supervisor.stop()
        self._pool.shutdown(wait=True, cancel_futures=cancel)
        for supervisor in self._supervisors:
            supervisor.close()
        if self._fork_server is not None:
            self._fork_server.close()

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, what it printed at its end) of the first episodes that broke since this was asked last."""
        with self._lock:
            words, self._words = tuple(self._words), []
        return words

    def heard(self, result: EpisodeResult, output: str) -> None:
        """Keep what a worker printed in an episode that broke, for people."""
        printed = output.strip()
        if not printed or result.outcome not in (Outcome.AGENT_ERROR, Outcome.INFRA_ERROR):
            return
        with self._lock:
            if len(self._words) < _MOST_EPISODES:
                self._words.append(
                    (str(result.episode), printed if len(printed) <= _WORDS else f"...{printed[-_WORDS:]}")
                )

    def _drive(self, request: EpisodeRequest) -> EpisodeResult:
        supervisor: Supervisor | None = getattr(self._own, "supervisor", None)
        if supervisor is None:
            assert self._fork_server is not None  # submit made it
            supervisor = self._own.supervisor = Supervisor(self._fork_server, self._limits)
            with self._lock:
                self._supervisors.append(supervisor)
                if self._closed:
                    supervisor.stop()
        result = supervisor.drive(request)
        self.heard(result, supervisor.output)
        return result


def lockstep_in_processes(
    worker_setup: Callable[[], WorkerSetup],
    limits: Limits,
    *,
    workers: int,
    width: int,
    shares: Callable[[str], bool],
) -> LockstepExecutor:
    """Return an executor that drives `workers` batches of up to `width` episodes, each in a process of its own.

    No process is started, and `worker_setup` not called, before the first episode.
    """
    one_by_one = ProcessExecutor(worker_setup, limits, slots=workers)

    def make_drivers() -> list[Supervisor]:
        return [Supervisor(one_by_one.fork_server(), limits, width=width) for _ in range(workers)]

    return LockstepExecutor(
        one_by_one, make_drivers, width=width, shares=shares, threads=workers, heard=one_by_one.heard
    )
