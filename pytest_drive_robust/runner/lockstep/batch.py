"""A batch of fixed size: the episodes that ask in this tick, and stand-ins for the rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.contract import agent_act_batch, agent_reset
from pytest_drive_robust.runner.episode.loop import RunningEpisode, private_truth, tell_phase

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.runner.episode.loop import Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["ROWS", "WIDTH", "Batch", "LockstepEpisode", "own_copy"]

ROWS = 4
"""Widths are multiples of this: with one thread they agree to the bit where smaller and uneven batches do not."""
WIDTH = 8
"""Episodes in lockstep when nobody says otherwise: sixteen gain nothing more where six cameras fill the cache."""


@dataclass(eq=False, slots=True)
class LockstepEpisode:
    """A request under way, and the seconds of wall time that it took so far."""

    request: EpisodeRequest
    running: RunningEpisode
    share_s: float

    @property
    def measures_inference(self) -> bool:
        """Return whether the setting needs the seconds of one call of `act`, which no row of a batch has."""
        return any(getattr(item, "measures_inference", False) for item in self.request.setting.perturbations)

    def sense(self) -> Observation | None:
        """Return what the agent is to act on; None when it is not asked, in which case the tick is over."""
        running = self.running
        if running.over:
            return None
        given = running.attempt(running.sense)
        if given is None and not running.over:
            running.attempt(lambda: running.advance(None, 0.0))
        return given

    def answer(self, answer: Control | AgentError, inference_s: float) -> None:
        """Drive the rest of the tick with what the agent answered or did wrong."""
        running = self.running
        if isinstance(answer, AgentError):
            running.crash = answer
        else:
            running.attempt(lambda: running.advance(answer, inference_s))


class Batch:
    """Asks in batches of one size. Rows that nobody needs are filled by stand-ins.

    A stand-in is an agent object of its own that follows one of the episodes, reset like that one's agent and given
    the same observations. Its answers are thrown away.
    """

    def __init__(self, width: int, take_agent: Callable[[], Agent], watch: Watch | None) -> None:
        self._width = width
        self._take_agent = take_agent
        self._watch = watch
        self._stand_ins: list[tuple[Agent, RunningEpisode | None]] = []  # and whom each follows

    def ask(self, asked: Sequence[tuple[RunningEpisode, Observation]]) -> tuple[list[Control | AgentError], float]:
        """Return an answer for each, and each one's share of the seconds. Raises `AgentError` for all of them."""
        try:
            self._enter("reset", asked[0][0])
            rows = [(episode.agent, given) for episode, given in asked]
            rows += [self._stand_in(number, asked) for number in range(self._width - len(asked))]
            agents, observations = tuple(agent for agent, _ in rows), tuple(given for _, given in rows)
            self._enter("act", asked[0][0])
            started_s = time.perf_counter()
            answers = agent_act_batch(agents, observations)
            inference_s = time.perf_counter() - started_s
        except AgentError:
            self._stand_ins = []  # in any state: not to be used again
            raise
        finally:
            self._enter("sim", asked[0][0])
        return answers[: len(asked)], inference_s / len(asked)

    def give_back(self) -> list[Agent]:
        """Return the agent objects that stood in, for other uses."""
        stand_ins, self._stand_ins = self._stand_ins, []
        return [agent for agent, _ in stand_ins]

    def _stand_in(self, number: int, asked: Sequence[tuple[RunningEpisode, Observation]]) -> tuple[Agent, Observation]:
        if number == len(self._stand_ins):
            self._stand_ins.append((self._take_agent(), None))
        agent, followed = self._stand_ins[number]
        episode, given = next((pair for pair in asked if pair[0] is followed), asked[number % len(asked)])
        if episode is not followed:
            assert episode.plan is not None  # it has been started
            agent_reset(agent, episode.plan, episode.seed)
            self._stand_ins[number] = agent, episode
        return agent, own_copy(given)

    def _enter(self, phase: str, first: RunningEpisode) -> None:
        tell_phase(self._watch, phase, first.recorder.ticks)


def own_copy(observation: Observation) -> Observation:
    """Return the same observation in memory that nobody else writes to."""
    truth = observation.truth
    return replace(observation.private(), truth=None if truth is None else private_truth(truth))
