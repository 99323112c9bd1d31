"""What drives episodes in one process: its world and its agents, and the one place where an agent is made."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.runner.episode.generators import borrowed_for, borrowed_generators
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.machine import with_machine

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.episode.loop import OnTick, Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["EpisodeDriver", "make_agent"]


class EpisodeDriver:
    """One world and one agent object per name serve all episodes; what broke in one of them is made anew.

    `make_agent` is given a name. What drives is `wrap` of the agent that was made. `on_tick` and `watch` are those of
    `drive_episode`.
    """

    def __init__(
        self,
        make_world: Callable[[], Simulator],
        make_agent: Callable[[str], Agent],
        *,
        wrap: Callable[[Agent], Agent] = lambda agent: agent,
        on_tick: OnTick | None = None,
        watch: Watch | None = None,
    ) -> None:
        self._make_world = make_world
        self._make_agent = make_agent
        self._wrap = wrap
        self._on_tick = on_tick
        self._watch = watch
        self._world: Simulator | None = None
        self._agents: dict[str, Agent] = {}

    def drive(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive an episode once. Raises `UsageError` when the world or the agent cannot be made."""
        name = request.episode.agent
        with borrowed_for(request.episode):
            world = self.world()
            if name not in self._agents:
                self._agents[name] = self._make_agent(name)
            agent = self._agents[name]
            result = drive_episode(
                world,
                self._wrap(agent),
                route=request.route,
                setting=request.setting,
                seed=request.episode.seed,
                agent_name=name,
                on_tick=self._on_tick,
                watch=self._watch,
            )
        if result.outcome is Outcome.AGENT_ERROR:  # what raised in the middle of an episode may be in any state
            del self._agents[name]
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
        return with_machine(result, agent, world)

    def world(self) -> Simulator:
        """Return the world, made when it is first asked for."""
        if self._world is None:
            self._world = self._make_world()
        return self._world

    def close(self) -> None:
        """Close the world and drop the agents. Calling it twice does no harm."""
        self._agents.clear()
        if self._world is not None:
            self._world.close()
            self._world = None


def make_agent(registry: Registry, name: str) -> Agent:
    """Build the agent of that name; the same object every time, whatever its constructor draws.

    The global generators are seeded by the agent's name alone while the constructor runs, and put back afterwards. By
    its name and not by the episode: one object is kept for many episodes, and which of them comes first depends on the
    order, the number of processes and what is stored already. An object that is made anew after an error must be the
    one that it replaces, too. What is drawn after the constructor is seeded by the episode (`generators.borrowed_for`).

    Raises `UsageError` when there is no such agent or it cannot be made.
    """
    with borrowed_generators(f"making {name}"):
        return registry.agent(name)
