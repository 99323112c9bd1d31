"""Many episodes at once in one process, for agents that answer many observations in one call (`act_batch`).

Every episode has a world and an agent object of its own; only the calls of `act` are made together. A batch always
has the same number of rows: where fewer episodes ask, stand-ins fill it, because the bits of a matrix product depend
on its shape. With one thread and `check_lockstep` passed, an episode comes out the same to the last bit whoever shares
the batch with it, in whichever order, and however early the others end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.loop import RunningEpisode, drive_episode
from pytest_drive_robust.runner.lockstep.batch import ROWS, Batch
from pytest_drive_robust.runner.lockstep.episode import LockstepEpisode, measures_inference

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.truth import WorldState
    from pytest_drive_robust.runner.episode.loop import OnTick, Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["WIDTH", "Lockstep"]

WIDTH = 8
"""Episodes in lockstep when nobody says otherwise: sixteen gain nothing more where six cameras fill the cache."""


class Lockstep:
    """Drives `width` episodes of one agent side by side, tick by tick.

    `make_world` and `make_agent` make as many as are needed, which are kept for the next episodes. `ticked` is called
    after every tick of all, `on_tick` after every tick of each as in `drive_episode`; `watch` is told whose code runs,
    the tick of `"act"` being that of the first row.

    A result says `lockstep=8` in `versions`, and its `wall_s` is the episode's share of the time that all took.
    A setting that measures the time of inference is driven alone by the agent's own `act`, as a batch has no time per
    row. Raises `ValueError` for a width that is no positive multiple of four, and for requests of two agents.
    """

    def __init__(
        self,
        make_world: Callable[[], Simulator],
        make_agent: Callable[[], Agent],
        *,
        width: int = WIDTH,
        watch: Watch | None = None,
        ticked: Callable[[], object] | None = None,
        on_tick: OnTick | None = None,
    ) -> None:
        if width < ROWS or width % ROWS:
            raise ValueError(f"the width of lockstep is {width}, expected a multiple of {ROWS} such as {WIDTH}")
        self.width = width
        self._make_world = make_world
        self._make_agent = make_agent
        self._watch = watch
        self._ticked = ticked
        self._on_tick = on_tick
        self.agent_name: str | None = None
        self._worlds: list[Simulator] = []
        self._free_worlds: list[Simulator] = []
        self._free_agents: list[Agent] = []

    def drive(self, requests: Iterable[EpisodeRequest]) -> Generator[tuple[EpisodeRequest, EpisodeResult], None, None]:
        """Yield every request with its result as soon as it ends. `requests` is read when a place is free, not before.

        Never raises for what agent, world or perturbations do: see `drive_episode` for how that ends. When a whole
        batch breaks, its episodes begin again one by one, so that only the guilty one ends in `agent_error`.
        """
        waiting = iter(requests)
        live: list[LockstepEpisode] = []
        batch = self._batch()
        try:
            while True:
                while len(live) < self.width and (request := next(waiting, None)) is not None:
                    if measures_inference(request.setting):
                        yield request, self._drive_measured(request)
                    else:
                        live.append(self._begin(request))
                if not live:
                    return
                broken = self._round(live, batch)
                ended = [episode for episode in live if episode.running.over]
                live = [episode for episode in live if episode not in broken and episode not in ended]
                self._free_worlds += [episode.running.simulator for episode in broken]
                yield from [self._end(episode) for episode in ended]
                for episode in broken:
                    yield self._drive_alone(episode.request)
        finally:  # also when the caller wants no more of them
            self._free_agents += batch.give_back()
            self._free_worlds += [episode.running.simulator for episode in live]

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        for world in self._worlds:
            world.close()
        for kept in (self._worlds, self._free_worlds, self._free_agents):
            kept.clear()

    def _begin(self, request: EpisodeRequest) -> LockstepEpisode:
        self._check_agent(request)
        started_s = time.perf_counter()
        world, agent = self._take_world(), self._take_agent()
        running = RunningEpisode(world, agent, request.route, request.setting, request.episode.seed, watch=self._watch)
        running.attempt(running.start)
        return LockstepEpisode(request, running, time.perf_counter() - started_s)

    def _round(self, live: Sequence[LockstepEpisode], batch: Batch, *, alone: bool = False) -> list[LockstepEpisode]:
        """Drive one tick of every episode. Return those whose batch broke, nobody knows by whose fault."""
        started_s = time.perf_counter()
        asked = [(episode, given) for episode in live if (given := episode.sense()) is not None]
        broken: list[LockstepEpisode] = []
        if asked:
            try:
                answers, inference_s = batch.ask([(episode.running, given) for episode, given in asked])
            except AgentError as error:
                broken = [episode for episode, _ in asked]
                if alone:
                    broken.pop().running.crash = error
            else:
                for (episode, _), answer in zip(asked, answers, strict=True):
                    episode.answer(answer, inference_s)
        self._tell_ticks(live)
        share_s = (time.perf_counter() - started_s) / len(live)
        for episode in live:
            episode.share_s += share_s
        return broken

    def _tell_ticks(self, live: Sequence[LockstepEpisode]) -> None:
        if self._ticked is not None:
            self._ticked()
        if self._on_tick is not None:
            for last_tick in [episode.running.last_tick for episode in live]:
                if last_tick is not None:
                    self._on_tick(*last_tick)

    def _end(self, episode: LockstepEpisode) -> tuple[EpisodeRequest, EpisodeResult]:
        result = episode.running.result(episode.request.episode)
        self._give_back(episode.running.simulator, episode.running.agent, result.outcome)
        versions = {**result.versions, "lockstep": str(self.width)}
        return episode.request, replace(result, wall_s=episode.share_s, versions=versions)

    def _drive_alone(self, request: EpisodeRequest) -> tuple[EpisodeRequest, EpisodeResult]:
        """Drive from start to end in a batch whose other rows follow the same episode."""
        batch, episode = self._batch(), self._begin(request)
        while not episode.running.over:
            self._round([episode], batch, alone=True)
        self._free_agents += batch.give_back()
        return self._end(episode)

    def _drive_measured(self, request: EpisodeRequest) -> EpisodeResult:
        self._check_agent(request)
        world, agent, episode = self._take_world(), self._take_agent(), request.episode

        def on_tick(tick: int, state: WorldState, observation: Observation, applied: Control) -> None:
            if self._ticked is not None:
                self._ticked()
            if self._on_tick is not None:
                self._on_tick(tick, state, observation, applied)

        result = drive_episode(
            world,
            agent,
            route=request.route,
            setting=request.setting,
            seed=episode.seed,
            agent_name=episode.agent,
            on_tick=on_tick,
            watch=self._watch,
        )
        self._give_back(world, agent, result.outcome)
        return result

    def _batch(self) -> Batch:
        return Batch(self.width, self._take_agent, self._watch)

    def _check_agent(self, request: EpisodeRequest) -> None:
        if self.agent_name not in (None, request.episode.agent):
            raise ValueError(f"{request.episode} cannot share a batch with episodes of {self.agent_name}")
        self.agent_name = request.episode.agent

    def _take_agent(self) -> Agent:
        return self._free_agents.pop() if self._free_agents else self._make_agent()

    def _take_world(self) -> Simulator:
        if self._free_worlds:
            return self._free_worlds.pop()
        world = self._make_world()
        self._worlds.append(world)
        return world

    def _give_back(self, world: Simulator, agent: Agent, outcome: Outcome) -> None:
        """Keep what can be used again: what raised in the middle of an episode may be in any state."""
        if outcome is Outcome.INFRA_ERROR:
            self._worlds.remove(world)
            world.close()
            return
        self._free_worlds.append(world)
        if outcome is not Outcome.AGENT_ERROR:
            self._free_agents.append(agent)
