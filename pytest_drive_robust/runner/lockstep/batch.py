"""Batches of checked sizes, made of the episodes that ask in a tick and of stand-ins."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.contract import agent_act_batch, agent_reset
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.episode.watch import Watch

ROWS = 4
"""Widths are multiples of this number: with one thread they agree to the bit; smaller and uneven batches do not."""
WIDTH = 8
"""Default number of episodes in lockstep: sixteen are no faster when six cameras fill the cache."""


def sizes(width: int) -> tuple[int, ...]:
    """Return the sizes of the batches that hold up to `width` episodes: 4, 8, 16 and so on, and `width` itself."""
    return (*(ROWS << doubled for doubled in range((width // ROWS - 1).bit_length())), width)


class Batch:
    """Asks agents in a batch of the smallest of the `sizes` that holds all asking episodes; stand-ins fill free rows.

    With one fixed size, the last episode of a run would pay for seven more rows in every tick. A stand-in is another
    agent object that follows one of the episodes: it is reset like that episode's agent and given the same
    observations. Its answers are discarded.
    """

    def __init__(self, width: int, take_agent: Callable[[], Agent], watch: Watch) -> None:
        self._sizes = sizes(width)
        self._take_agent = take_agent
        self._watch = watch
        self._stand_ins: list[tuple[Agent, RunningEpisode | None]] = []  # each with the episode that it follows

    def ask(self, asked: Sequence[tuple[RunningEpisode, Observation]]) -> tuple[list[Control | AgentError], float]:
        """Return an answer for each asking episode, and the seconds of the call divided by their number.

        Raises `AgentError` when the whole batch broke.
        """
        tick = asked[0][0].ticks
        try:
            self._watch.phase("reset", tick)
            rows = [(episode.agent, given) for episode, given in asked]
            rows += [self._stand_in(number, asked) for number in range(self._size(len(asked)) - len(asked))]
            agents, observations = tuple(agent for agent, _ in rows), tuple(given for _, given in rows)
            self._watch.phase("act", tick)
            started_s = time.perf_counter()
            answers = agent_act_batch(agents, observations)
            inference_s = time.perf_counter() - started_s
        except AgentError:
            self._stand_ins = []  # in any state: not to be used again
            raise
        finally:
            self._watch.phase("sim", tick)
        return answers[: len(asked)], inference_s / len(asked)

    def give_back(self) -> list[Agent]:
        """Return the agent objects of the stand-ins, for reuse."""
        stand_ins, self._stand_ins = self._stand_ins, []
        return [agent for agent, _ in stand_ins]

    def _size(self, asking: int) -> int:
        return next(size for size in self._sizes if size >= asking)

    def _stand_in(self, number: int, asked: Sequence[tuple[RunningEpisode, Observation]]) -> tuple[Agent, Observation]:
        if number == len(self._stand_ins):
            self._stand_ins.append((self._take_agent(), None))
        agent, followed = self._stand_ins[number]
        episode, given = next((pair for pair in asked if pair[0] is followed), asked[number % len(asked)])
        if episode is not followed:
            assert episode.plan is not None  # it has been started
            agent_reset(agent, episode.plan, episode.seed)
            self._stand_ins[number] = agent, episode
        return agent, given.private()
