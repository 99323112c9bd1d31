"""Who turns requests into finished episodes: the protocol, and the simplest one, which is this process."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.generators import borrowed_for
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.make_agent import make_agent

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions

__all__ = ["DRIVEN_AGAIN", "Executor", "InlineExecutor"]

DRIVEN_AGAIN = 2
"""How often an episode is driven again when its end was not the agent's doing."""


class Executor(Protocol):
    """Drives episodes, at most `slots` at a time.

    An episode that breaks is a result too (`agent_error`, `infra_error`): the only exceptions of a future are
    `UsageError`, when the agent or the simulator cannot be made at all, and `Stopped`, when `close` cut it off.

    An executor that drives in the thread of its caller but not within `submit` has a `work()`, too: it is called while
    somebody waits, again and again, and returns when something has ended or nothing is left to drive.
    """

    @property
    def slots(self) -> int:
        """How many episodes it can drive at this moment."""
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

    One simulator and one agent object per name serve all episodes. `ticked` is called after every tick.
    """

    slots = 1

    def __init__(
        self, registry: Registry, *, simulator: str, options: SimulatorOptions, ticked: Callable[[], object]
    ) -> None:
        self._registry = registry
        self._simulator_name = simulator
        self._options = options
        self._ticked = ticked
        self._simulator: Simulator | None = None
        self._agents: dict[str, Agent] = {}

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Drive the episode to its end before this returns."""
        future: Future[EpisodeResult] = Future()
        for _ in range(1 + DRIVEN_AGAIN):
            try:
                with borrowed_for(request.episode):
                    result = self._drive(request)
            except UsageError as error:
                future.set_exception(error)
                return future
            self._forget_broken(request, result)
            if result.outcome is not Outcome.INFRA_ERROR:
                break
        future.set_result(result)
        return future

    def close(self, *, cancel: bool = False) -> None:
        """Close the simulator and drop the agents. Nothing is under way between two calls."""
        self._agents.clear()
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _drive(self, request: EpisodeRequest) -> EpisodeResult:
        episode = request.episode
        if self._simulator is None:
            self._simulator = self._registry.simulator(self._simulator_name, self._options)
        if episode.agent not in self._agents:
            self._agents[episode.agent] = make_agent(self._registry, episode.agent)
        agent = self._agents[episode.agent]
        result = drive_episode(
            self._simulator,
            agent,
            route=request.route,
            setting=request.setting,
            seed=episode.seed,
            agent_name=episode.agent,
            on_tick=lambda *_: self._ticked(),
        )
        return with_machine(result, agent)

    def _forget_broken(self, request: EpisodeRequest, result: EpisodeResult) -> None:
        """Drop what raised in the middle of an episode, which may be in any state: the next episode gets a new one."""
        if result.outcome is Outcome.AGENT_ERROR:
            self._agents.pop(request.episode.agent, None)
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
