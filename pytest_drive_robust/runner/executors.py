"""Who turns tasks into finished episodes. For now: this process, one episode after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.runner.plan import Task

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions

__all__ = ["Executor", "InlineExecutor", "Listener"]


class Listener(Protocol):
    """Who wants to know what an executor is doing."""

    def started(self, task: Task) -> None:
        """An episode begins."""
        ...

    def ticked(self) -> None:
        """An episode is still under way. Called often: return at once."""
        ...


class Executor(Protocol):
    """Drives episodes."""

    def drive(self, tasks: Iterable[Task], listener: Listener) -> Iterator[tuple[Task, EpisodeResult]]:
        """Every task with its result, in any order. `tasks` is read lazily: what is not asked for is not driven.

        An episode that breaks is a result too (`agent_error`, `infra_error`). Raises `UsageError` when the agent or
        the simulator cannot be made at all.
        """
        ...

    def close(self) -> None:
        """Free simulators and agents. Calling it twice does no harm."""
        ...


class InlineExecutor:
    """Drives in this process. One simulator and one agent object per name serve all episodes."""

    def __init__(self, registry: Registry, *, simulator: str, options: SimulatorOptions) -> None:
        self._registry = registry
        self._simulator_name = simulator
        self._options = options
        self._simulator: Simulator | None = None
        self._agents: dict[str, Agent] = {}

    def drive(self, tasks: Iterable[Task], listener: Listener) -> Iterator[tuple[Task, EpisodeResult]]:
        """Every task with its result, in the order of `tasks`."""
        for task in tasks:
            listener.started(task)
            result = self._drive(task, listener)
            self._forget_broken(task, result)
            yield task, result

    def close(self) -> None:
        """Close the simulator and drop the agents."""
        self._agents.clear()
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _drive(self, task: Task, listener: Listener) -> EpisodeResult:
        from pytest_drive_robust.runner.loop import drive_episode

        episode = task.episode
        if self._simulator is None:
            self._simulator = self._registry.simulator(self._simulator_name, self._options)
        if episode.agent not in self._agents:
            self._agents[episode.agent] = self._registry.agent(episode.agent)
        return drive_episode(
            self._simulator,
            self._agents[episode.agent],
            route=task.route,
            setting=task.setting,
            seed=episode.seed,
            agent_name=episode.agent,
            on_tick=lambda *_: listener.ticked(),
        )

    def _forget_broken(self, task: Task, result: EpisodeResult) -> None:
        """What raised in the middle of an episode may be in any state: the next episode gets a new one."""
        if result.outcome is Outcome.AGENT_ERROR:
            self._agents.pop(task.episode.agent, None)
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
