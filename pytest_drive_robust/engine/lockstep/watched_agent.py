"""An agent among others, as a worker process drives it in lockstep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.engine.worker.watched_agent import WatchedAgent, call_contained

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import CameraSpec, Observation
    from pytest_drive_robust.domain.route import GlobalPlan
    from pytest_drive_robust.engine.shared_state import SharedState

__all__ = ["BatchedAgent"]


class BatchedAgent(WatchedAgent):
    """As `WatchedAgent`, with `act_batch`. `answered` is given what every call of the agent returned, row by row."""

    def __init__(self, agent: Agent, state: SharedState, descriptor: int, answered: Callable[[object], None]) -> None:
        super().__init__(agent, state, descriptor)
        self._answered = answered
        self._told = False

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the agent's cameras: it drives an episode of its own."""
        self._told = True
        return super().sensors()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Reset the agent. A stand-in is not asked for its cameras, and leaves the rig of the episode as it is."""
        if self._told:
            self._told = False
            super().reset(route, seed)
        else:
            call_contained(self._agent.reset, route, seed)

    def act(self, observation: Observation) -> Control:
        """Return the control of one that drives alone: where the time of inference is measured."""
        control = super().act(observation)
        self._answered([control])
        return control

    def act_batch(self, rows: Sequence[BatchedAgent], observations: Sequence[Observation]) -> Sequence[Control]:
        """Return the agents' own answers."""
        agents: list[Any] = [row._agent for row in rows]
        answers: Sequence[Control] = call_contained(agents[0].act_batch, agents, observations)
        self._check_connection()
        self._answered(answers)
        return answers
