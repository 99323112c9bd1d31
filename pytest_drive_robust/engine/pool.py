"""The executor of worker processes: each driver is the supervisor of one worker; one fork server forks all workers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.runner.local_executor import LocalExecutor

if TYPE_CHECKING:
    from pytest_drive_robust.engine.fork_server import ForkServer
    from pytest_drive_robust.engine.supervisor import Supervisor


class ProcessExecutor(LocalExecutor):
    """Drives in `slots` worker processes. A worker lives until the run ends or an episode breaks the worker.

    No process is started, and `worker_setup` not called, before the first episode. `check_loaded`: see `ForkServer`.
    """

    def __init__(
        self,
        worker_setup: Callable[[], WorkerSetup],
        limits: Limits,
        *,
        slots: int,
        width: int | None = None,
        shares: Callable[[str], bool] = lambda agent: False,
        check_loaded: Callable[[], None] = lambda: None,
    ) -> None:
        self._fork_server: ForkServer | None = None
        self._supervisors: list[Supervisor] = []

        def make_supervisors(agent: str) -> list[Supervisor]:
            from pytest_drive_robust.engine.fork_server import ForkServer  # a run from the store needs neither
            from pytest_drive_robust.engine.supervisor import Supervisor

            setup = worker_setup()
            agents = sorted(setup.preload_agents, key=lambda name: name != agent)  # its kernels are compiled first
            self._fork_server = server = ForkServer(replace(setup, preload_agents=tuple(agents)), check_loaded)
            self._supervisors = [Supervisor(server, limits) for _ in range(slots)]
            return self._supervisors

        super().__init__(make_supervisors, threads=slots, width=width, shares=shares)

    def drives(self, agent: str) -> bool:
        """Return whether the agent can be driven; False while only other agents' kernels are compiled."""
        return self._fork_server is None or self._fork_server.drives(agent)

    @property
    def compiling(self) -> tuple[int, int]:
        """(done, total) of the functions that an agent waits for; equal while a worker drives: no agent waits then."""
        if self._fork_server is None:
            return 0, 0
        done, total = self._fork_server.compiling
        drives = self._fork_server.is_ready and len(self._idle) < len(self._supervisors)
        return (total, total) if drives else (done, total)

    def close(self) -> None:
        """End all workers, also those that drive an episode."""
        for supervisor in self._supervisors:
            supervisor.stop()
        super().close()
        if self._fork_server is not None:
            self._fork_server.close()
