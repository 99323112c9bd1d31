"""The executor without worker processes: drives in this process, as a debugger needs."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.as_in_worker import as_in_worker
from pytest_drive_robust.runner.local_executor import LocalExecutor
from pytest_drive_robust.runner.lockstep.offered import factory_offers_lockstep
from pytest_drive_robust.simulators.base import SimulatorOptions


class InlineExecutor(LocalExecutor):
    """Drives in this process, for debuggers and prints: nothing protects the run from the agent.

    `ticked` is called after every tick of each episode. With a `width`, agents that offer lockstep are driven in
    batches. Episodes are driven in `folder` (default: the current folder) with the variables of `environment()`
    (default: the present ones).
    """

    def __init__(
        self,
        registry: Registry,
        *,
        simulator: str,
        options: SimulatorOptions,
        ticked: Callable[[], object],
        width: int | None = None,
        folder: Path | str = os.curdir,
        environment: Callable[[], Mapping[str, str] | None] = lambda: None,
    ) -> None:
        from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent  # worker processes have their own
        from pytest_drive_robust.runner.episode.threads import OneThread
        from pytest_drive_robust.runner.episode.watch import Watch

        self._one_thread = one_thread = OneThread()

        def made(name: str) -> Agent:
            agent = make_agent(registry, name)
            one_thread.limit()  # also libraries that the agent loaded
            return agent

        class _Ticks(Watch):
            """Calls `ticked` after every tick."""

            def ticked(self, *_: object) -> None:
                ticked()

        driver = EpisodeDriver(lambda: registry.simulator(simulator, options), made, watch=_Ticks())
        super().__init__(
            lambda agent: [driver], width=width, shares=lambda agent: factory_offers_lockstep(agent, registry)
        )
        self._simulator = simulator
        self._folder = folder
        self._environment = environment
        self._variables: dict[str, str] | None = None

    def _work(self) -> None:
        if self._variables is None:
            self._variables = dict(self._environment() or {})
        with self._one_thread, as_in_worker(self._folder, self._variables):
            super()._work()

    @functools.cached_property
    def compiling(self) -> tuple[int, int]:
        """(0, number of the embedded world's functions that were in no cache at the first call); (0, 0) elsewhere."""
        if self._simulator == "embedded":
            with suppress(ImportError):  # the episode reports a missing library
                from pytest_drive_robust.simulators.embedded.compiling import missing_functions  # loads numba

                return 0, missing_functions()
        return 0, 0
