"""The executor of worker processes: each driver is a supervisor of one, all forked from one fork server."""

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
    """Drives in `slots` worker processes, which live until the run ends or an episode breaks them.

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
            agents = sorted(setup.preload_agents, key=lambda name: name != agent)  # compiled for the first one first
            self._fork_server = server = ForkServer(replace(setup, preload_agents=tuple(agents)), check_loaded)
            self._supervisors = [Supervisor(server, limits) for _ in range(slots)]
            return self._supervisors

        super().__init__(make_supervisors, threads=slots, width=width, shares=shares)

    def drives(self, agent: str) -> bool:
        """Return False while kernels that this agent may need are compiled, and others can be driven already."""
        return self._fork_server is None or self._fork_server.drives(agent)

    @property
    def compiling(self) -> tuple[int, int]:
        """How many functions are compiled, of how many that are waited for: while an agent is driven, none is."""
        if self._fork_server is None:
            return 0, 0
        done, total = self._fork_server.compiling
        return (total, total) if self._fork_server.is_ready and len(self._idle) < self._workers else (done, total)

    def close(self) -> None:
        """End the workers, also those that drive."""
        for supervisor in self._supervisors:
            supervisor.stop()
        super().close()
        if self._fork_server is not None:
            self._fork_server.close()
