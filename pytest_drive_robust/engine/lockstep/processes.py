"""Lockstep in worker processes of this machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.lockstep.supervisor import LockstepSupervisor
from pytest_drive_robust.engine.pool import ProcessExecutor
from pytest_drive_robust.runner.lockstep.executor import LockstepExecutor

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["lockstep_in_processes"]


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

    def make_drivers() -> list[LockstepSupervisor]:
        return [LockstepSupervisor(one_by_one.fork_server(), limits, width=width) for _ in range(workers)]

    return LockstepExecutor(
        one_by_one, make_drivers, width=width, shares=shares, threads=workers, heard=one_by_one.heard
    )
