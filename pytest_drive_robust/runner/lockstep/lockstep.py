"""Many episodes at once in one process, for agents that answer many observations in one call (`act_batch`).

Every episode has a world and an agent object of its own; only the calls of `act` are made together. A batch always
has the same number of rows: where fewer episodes ask, stand-ins fill it, because the bits of a matrix product depend
on its shape. With one thread and `check_lockstep` passed, an episode comes out the same to the last bit whoever shares
the batch with it, in whichever order, and however early the others end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.executors import DRIVEN_AGAIN
from pytest_drive_robust.runner.lockstep.batch import ROWS, WIDTH, Batch, LockstepEpisode
from pytest_drive_robust.runner.lockstep.batch_check import admit

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.runner.episode.loop import OnTick, Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator


__all__ = ["Lockstep"]


class Lockstep:
    """Drives `width` episodes of one agent side by side, tick by tick (see `runner.lockstep.executor.BatchDriver`).

    `make_world` and `make_agent`, which is given a name, make as many as are needed; they are kept for the next
    episodes of that agent. What drives is `wrap` of the agent that was made. `on_tick` is called after every tick of
    each episode as in `drive_episode`; `watch` is told whose code runs, the tick of `"act"` being that of the first
    row.

    A result says `lockstep=8` in `versions`, and its `wall_s` is the episode's share of the time that all took.
    A setting that measures the time of inference is driven alone by the agent's own `act`, as a batch has no time per
    row. Raises `ValueError` for a width that is no positive multiple of four, and for two agents in a batch.
    """

    output = ""

    def __init__(
        self,
        make_world: Callable[[], Simulator],
        make_agent: Callable[[str], Agent],
        *,
        width: int = WIDTH,
        wrap: Callable[[Agent], Agent] = lambda agent: agent,
        watch: Watch | None = None,
        on_tick: OnTick | None = None,
    ) -> None:
        if width < ROWS or width % ROWS:
            raise ValueError(f"the width of lockstep is {width}, expected a multiple of {ROWS} such as {WIDTH}")
        self.width = width
        self._make_world = make_world
        self._make_agent = make_agent
        self._wrap = wrap
        self._watch = watch
        self._on_tick = on_tick
        self._agent_name = ""
        self._latest: Agent | None = None
        self._worlds: list[Simulator] = []
        self._free_worlds: list[Simulator] = []
        self._free_agents: list[Agent] = []

    def check(self, request: EpisodeRequest) -> bool:
        """See `BatchDriver.check`."""
        name = request.episode.agent
        world = self._make_world()
        try:
            with borrowed_generators(f"driving {name}"):
                return admit(world, lambda: self._made(name), request, width=self.width, watch=self._watch)
        finally:
            world.close()

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None]
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult], None, None]:
        """Yield every request with its result as soon as it ends. One is taken when a place is free, not before.

        Raises `UsageError` when the agent cannot be made, and never for what agent, world or perturbations do: see
        `drive_episode` for how that ends. When a whole batch breaks, its episodes begin again one by one, so that only
        the guilty one ends in `agent_error`.
        """
        if agent != self._agent_name:
            self.close()
            self._agent_name = agent
        driving = self._drive(take)
        try:
            while True:
                with borrowed_generators(f"driving {agent}"):
                    ended = next(driving, None)
                if ended is None:
                    return
                yield ended
        finally:
            driving.close()

    def drive_one(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive one in a batch of its own."""
        requests = [request]
        ((_, result),) = self.drive_batch(request.episode.agent, lambda: requests.pop() if requests else None)
        return result

    def drive(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive one in a batch of its own, again where the world broke."""
        for _ in range(1 + DRIVEN_AGAIN):
            result = self.drive_one(request)
            if result.outcome is not Outcome.INFRA_ERROR:
                break
        return result

    def stop(self) -> None:
        """Do nothing: between two calls nothing is under way."""

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        for world in self._worlds:
            world.close()
        for kept in (self._worlds, self._free_worlds, self._free_agents):
            kept.clear()
        self._latest = None

    def _drive(
        self, take: Callable[[], EpisodeRequest | None]
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult], None, None]:
        live: list[LockstepEpisode] = []
        batch = self._batch()
        try:
            while True:
                while len(live) < self.width and (request := take()) is not None:
                    episode = self._begin(request)
                    if episode.measures_inference:
                        yield self._drive_alone(episode)
                    else:
                        live.append(episode)
                if not live:
                    return
                broken = self._round(live, batch)
                ended = [episode for episode in live if episode.running.over]
                live = [episode for episode in live if episode not in broken and episode not in ended]
                self._free_worlds += [episode.running.simulator for episode in broken]
                yield from [self._end(episode) for episode in ended]
                for episode in broken:
                    yield self._drive_alone(self._begin(episode.request))
        finally:  # also when the caller wants no more of them
            self._free_agents += batch.give_back()
            self._free_worlds += [episode.running.simulator for episode in live]

    def _begin(self, request: EpisodeRequest) -> LockstepEpisode:
        if request.episode.agent != self._agent_name:
            raise ValueError(f"{request.episode} cannot share a batch with episodes of {self._agent_name}")
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
        if self._on_tick is not None:
            for last_tick in [episode.running.last_tick for episode in live]:
                if last_tick is not None:
                    self._on_tick(*last_tick)

    def _drive_alone(self, episode: LockstepEpisode) -> tuple[EpisodeRequest, EpisodeResult]:
        """Drive from start to end: by the agent's own `act`, or in a batch whose other rows follow the same episode."""
        batch, running = self._batch(), episode.running
        while not running.over:
            if episode.measures_inference:
                running.attempt(running.tick)
                self._tell_ticks([episode])
            else:
                self._round([episode], batch, alone=True)
        self._free_agents += batch.give_back()
        return self._end(episode)

    def _end(self, episode: LockstepEpisode) -> tuple[EpisodeRequest, EpisodeResult]:
        result = episode.running.result(episode.request.episode)
        self._give_back(episode.running.simulator, episode.running.agent, result.outcome)
        if not episode.measures_inference:
            versions = {**result.versions, "lockstep": str(self.width)}
            result = replace(result, wall_s=episode.share_s, versions=versions)
        return episode.request, with_machine(result, self._latest, episode.running.simulator)

    def _batch(self) -> Batch:
        return Batch(self.width, self._take_agent, self._watch)

    def _take_agent(self) -> Agent:
        return self._free_agents.pop() if self._free_agents else self._made(self._agent_name)

    def _made(self, name: str) -> Agent:
        self._latest = agent = self._make_agent(name)
        return self._wrap(agent)

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
