"""Who turns requests into finished episodes: the protocol, and the simplest one, which is this process."""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.driver import EpisodeDriver, make_agent

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import SimulatorOptions

__all__ = ["DRIVEN_AGAIN", "Executor", "InlineExecutor"]

DRIVEN_AGAIN = 2
"""How often an episode is driven again when its end was not the agent's doing."""


class Executor(Protocol):
    """Drives episodes, at most `slots` at a time.

    An episode that breaks is a result too (`agent_error`, `infra_error`): the only exceptions of a future are
    `UsageError`, when the agent or the simulator cannot be made at all, and `Stopped`, when `close` cut it off.

    An executor that drives in the thread of its caller but not within `submit` has a `work()`, too: it is called while
    somebody waits, again and again, and returns when something has ended or nothing is left to drive.

    An executor whose episodes may wait for a compiler says in `compiling` how many functions are compiled, of how many.
    """

    @property
    def slots(self) -> int:
        """Return how many episodes it can drive at this moment."""
        ...

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Begin an episode. The caller keeps to `slots`."""
        ...

    def close(self, *, cancel: bool = False) -> None:
        """Free simulators, agents and processes. With `cancel`, what is under way is cut off and has no result.

        Calling it twice does no harm.
        """
        ...


class InlineExecutor:
    """Drives in this process, for debuggers and prints: nothing protects the run from the agent.

    `ticked` is called after every tick.
    """

    slots = 1

    def __init__(
        self, registry: Registry, *, simulator: str, options: SimulatorOptions, ticked: Callable[[], object]
    ) -> None:
        self._simulator = simulator
        self._driver = EpisodeDriver(
            lambda: registry.simulator(simulator, options),
            lambda name: make_agent(registry, name),
            on_tick=lambda *_: ticked(),
        )

    @functools.cached_property
    def compiling(self) -> tuple[int, int]:
        """Of the functions of the embedded world that were in no cache when this was first asked, none is compiled."""
        if self._simulator == "embedded":
            with suppress(ImportError):  # the episode says so
                from pytest_drive_robust.simulators.embedded.compiling import missing_functions  # loads numba

                return 0, missing_functions()
        return 0, 0

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Drive the episode to its end before this returns."""
        future: Future[EpisodeResult] = Future()
        try:
            for _ in range(1 + DRIVEN_AGAIN):
                result = self._driver.drive(request)
                if result.outcome is not Outcome.INFRA_ERROR:
                    break
        except UsageError as error:
            future.set_exception(error)
        else:
            future.set_result(result)
        return future

    def close(self, *, cancel: bool = False) -> None:
        """Close the simulator and drop the agents. Nothing is under way between two calls."""
        self._driver.close()
