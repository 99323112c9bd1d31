"""A batch of fixed size: the episodes that ask in this tick, and stand-ins for the rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.contract import agent_act_batch, agent_reset
from pytest_drive_robust.runner.episode.loop import private_truth

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.runner.episode.loop import Drive, Watch

__all__ = ["ROWS", "Batch", "own_copy"]

ROWS = 4
"""Widths are multiples of this: with one thread they agree to the bit where smaller and uneven batches do not."""


class Batch:
    """Asks in batches of one size. Rows that nobody needs are filled by stand-ins.

    A stand-in is an agent object of its own that follows one of the episodes, reset like that one's agent and given
    the same observations. Its answers are thrown away.
    """

    def __init__(self, width: int, take_agent: Callable[[], Agent], watch: Watch | None) -> None:
        self._width = width
        self._take_agent = take_agent
        self._watch = watch
        self._crew: list[Agent] = []
        self._follows: list[Drive | None] = []

    def ask(self, asked: Sequence[tuple[Drive, Observation]]) -> tuple[list[Control | AgentError], float]:
        """An answer for each, and each one's share of the seconds that it took. Raises `AgentError` for all of them."""
        try:
            self._enter("reset", asked[0][0])
            rows = [(drive.agent, given) for drive, given in asked]
            rows += [self._stand_in(number, asked) for number in range(self._width - len(asked))]
            agents, observations = tuple(agent for agent, _ in rows), tuple(given for _, given in rows)
            self._enter("act", asked[0][0])
            started_s = time.perf_counter()
            answers = agent_act_batch(agents, observations)
            inference_s = time.perf_counter() - started_s
        except AgentError:
            self._crew, self._follows = [], []  # in any state: not to be used again
            raise
        finally:
            self._enter("sim", asked[0][0])
        return answers[: len(asked)], inference_s / len(asked)

    def dismiss(self) -> list[Agent]:
        """The agent objects that stood in, for other uses."""
        crew, self._crew, self._follows = self._crew, [], []
        return crew

    def _stand_in(self, number: int, asked: Sequence[tuple[Drive, Observation]]) -> tuple[Agent, Observation]:
        if number == len(self._crew):
            self._crew.append(self._take_agent())
            self._follows.append(None)
        agent, followed = self._crew[number], self._follows[number]
        drive, given = next((pair for pair in asked if pair[0] is followed), asked[number % len(asked)])
        if drive is not followed:
            assert drive.plan is not None  # it has been started
            agent_reset(agent, drive.plan, drive.seed)
            self._follows[number] = drive
        return agent, own_copy(given)

    def _enter(self, phase: str, drive: Drive) -> None:
        if self._watch is not None:
            self._watch.phase(phase, drive.recorder.ticks)


def own_copy(observation: Observation) -> Observation:
    """The same observation in memory that nobody else writes to."""
    truth = observation.truth
    return replace(observation.private(), truth=None if truth is None else private_truth(truth))
