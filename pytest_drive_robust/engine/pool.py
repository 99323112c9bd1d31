"""The executor of worker processes: each driver is a supervisor of one, all forked from one fork server."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.runner.executors import Driver, LocalExecutor

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["ProcessExecutor"]


class ProcessExecutor(LocalExecutor):
    """Drives in `slots` worker processes, which live until the run ends or an episode breaks them.

    No process is started, and `worker_setup` not called, before the first episode.
    """

    def __init__(
        self,
        worker_setup: Callable[[], WorkerSetup],
        limits: Limits,
        *,
        slots: int,
        width: int | None = None,
        shares: Callable[[str], bool] = lambda agent: False,
    ) -> None:
        super().__init__(threads=slots, width=width, shares=shares)
        self._setup = worker_setup
        self._limits = limits
        self._fork_server: ForkServer | None = None

    def make_drivers(self) -> Sequence[Driver]:
        """Return the supervisors. Raises `UsageError` where no worker could load what we have."""
        self._fork_server = server = ForkServer(self._setup())
        return [Supervisor(server, self._limits) for _ in range(self._workers)]

    @property
    def compiling(self) -> tuple[int, int]:
        """How many functions are compiled, of how many that the workers wait for."""
        return self._fork_server.compiling if self._fork_server is not None else (0, 0)

    def close(self, *, cancel: bool = False) -> None:
        """End the workers. With `cancel`, those that drive are killed; without, they come to their end first."""
        super().close(cancel=cancel)
        if self._fork_server is not None:
            self._fork_server.close()
