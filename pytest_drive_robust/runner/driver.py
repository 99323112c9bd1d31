"""What drives episodes in one process: its worlds and its agents, and the one place where an agent is made.

An episode is driven by the agent's own `act`, or side by side with others of its agent that answers many observations
in one call (`act_batch`): in lockstep. There every episode has a world and an agent object of its own; only the calls
are made together. A batch always has the same number of rows: where fewer episodes ask, stand-ins fill it, because the
bits of a matrix product depend on its shape. With one thread and `check_lockstep` passed, an episode comes out the same
to the last bit whoever shares the batch with it, in whichever order, and however early the others end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.generators import borrowed_for, borrowed_generators
from pytest_drive_robust.runner.episode.loop import RunningEpisode, drive_episode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.lockstep.batch import ROWS, WIDTH, Batch, LockstepEpisode
from pytest_drive_robust.runner.lockstep.batch_check import admit

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.episode.loop import OnTick, Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator

    Ended = Generator[tuple[EpisodeRequest, EpisodeResult], None, None]

__all__ = ["DRIVEN_AGAIN", "EpisodeDriver", "make_agent"]

DRIVEN_AGAIN = 2
"""How often an episode is driven again when its end was not the agent's doing."""


class EpisodeDriver:
    """Worlds and agent objects serve one episode after the other; what broke in one of them is made anew.

    `make_agent` is given a name. What drives is `wrap` of the agent that was made. `on_tick` is called after every tick
    of each episode and `watch` told whose code runs, as in `drive_episode`; in lockstep the tick of `"act"` is that of
    the first row.
    """

    output = ""

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
        self._worlds: list[Simulator] = []
        self._free_worlds: list[Simulator] = []
        self._free_agents: dict[str, list[Agent]] = {}
        self._latest: dict[str, Agent] = {}

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive an episode, with a `width` in a batch of its own; again where the world broke. Raises `UsageError`."""
        for _ in range(1 + DRIVEN_AGAIN):
            result = self.drive_once(request) if width is None else self._drive_in_own_batch(request, width)
            if result.outcome is not Outcome.INFRA_ERROR:
                break
        return result

    def drive_once(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive an episode by `act`. Raises `UsageError` when the world or the agent cannot be made."""
        name = request.episode.agent
        with borrowed_for(request.episode):
            world = self._take_world()
            agent = self._take_agent(name)
            result = drive_episode(
                world,
                agent,
                route=request.route,
                setting=request.setting,
                seed=request.episode.seed,
                agent_name=name,
                on_tick=self._on_tick,
                watch=self._watch,
            )
        self._give_back(world, name, agent, result.outcome)
        return with_machine(result, self._latest[name], world)

    def check(self, request: EpisodeRequest, width: int) -> bool:
        """Return whether the agent may be driven in lockstep (see `batch_check.admit`)."""
        name = request.episode.agent
        world = self._make_world()
        try:
            with borrowed_generators(f"driving {name}"):
                return admit(world, lambda: self._made(name), request, width=width, watch=self._watch)
        finally:
            world.close()

    def drive_batch(self, agent: str, take: Callable[[], EpisodeRequest | None], width: int = WIDTH) -> Ended:
        """Drive up to `width` episodes at once; yield each with its result as soon as it ends.

        One is taken when a place is free, not before. A result says `lockstep=8` in `versions`, and its `wall_s` is the
        episode's share of the time that all took. A setting that measures the time of inference is driven alone by the
        agent's own `act`, as a batch has no time per row.

        Raises `UsageError` when the agent cannot be made, `ValueError` for a width that is no positive multiple of four
        and for two agents in a batch, and never for what agent, world or perturbations do: see `drive_episode` for how
        that ends. When a whole batch breaks, its episodes begin again one by one, so that only the guilty one ends in
        `agent_error`.
        """
        if width < ROWS or width % ROWS:
            raise ValueError(f"the width of lockstep is {width}, expected a multiple of {ROWS} such as {WIDTH}")
        self._free_agents = {agent: self._free_agents.get(agent, [])}  # a batch of another one holds many objects
        driving = self._drive_together(agent, take, width)
        try:
            while True:
                with borrowed_generators(f"driving {agent}"):
                    ended = next(driving, None)
                if ended is None:
                    return
                yield ended
        finally:
            driving.close()

    def world(self) -> Simulator:
        """Return a world, made when there is none yet."""
        if not self._worlds:
            self._free_worlds.append(self._take_world())
        return self._worlds[0]

    def stop(self) -> None:
        """Do nothing: between two calls nothing is under way."""

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        for world in self._worlds:
            world.close()
        for kept in (self._worlds, self._free_worlds):
            kept.clear()
        self._free_agents.clear()

    def _drive_in_own_batch(self, request: EpisodeRequest, width: int) -> EpisodeResult:
        requests = [request]
        ((_, result),) = self.drive_batch(request.episode.agent, lambda: requests.pop() if requests else None, width)
        return result

    def _drive_together(self, agent: str, take: Callable[[], EpisodeRequest | None], width: int) -> Ended:
        live: list[LockstepEpisode] = []
        batch = self._batch(agent, width)
        try:
            while True:
                while len(live) < width and (request := take()) is not None:
                    if request.episode.agent != agent:
                        raise ValueError(f"{request.episode} cannot share a batch with episodes of {agent}")
                    episode = self._begin(request)
                    if episode.measures_inference:
                        yield self._drive_alone(episode, width)
                    else:
                        live.append(episode)
                if not live:
                    return
                broken = self._round(live, batch)
                ended = [episode for episode in live if episode.running.over]
                live = [episode for episode in live if episode not in broken and episode not in ended]
                self._free_worlds += [episode.running.simulator for episode in broken]
                yield from [self._end(episode, width) for episode in ended]
                for episode in broken:
                    yield self._drive_alone(self._begin(episode.request), width)
        finally:  # also when the caller wants no more of them
            self._free_agents.setdefault(agent, []).extend(batch.give_back())
            self._free_worlds += [episode.running.simulator for episode in live]

    def _begin(self, request: EpisodeRequest) -> LockstepEpisode:
        started_s = time.perf_counter()
        world, agent = self._take_world(), self._take_agent(request.episode.agent)
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

    def _drive_alone(self, episode: LockstepEpisode, width: int) -> tuple[EpisodeRequest, EpisodeResult]:
        """Drive from start to end: by the agent's own `act`, or in a batch whose other rows follow the same episode."""
        agent, running = episode.request.episode.agent, episode.running
        batch = self._batch(agent, width)
        while not running.over:
            if episode.measures_inference:
                running.attempt(running.tick)
                self._tell_ticks([episode])
            else:
                self._round([episode], batch, alone=True)
        self._free_agents.setdefault(agent, []).extend(batch.give_back())
        return self._end(episode, width)

    def _end(self, episode: LockstepEpisode, width: int) -> tuple[EpisodeRequest, EpisodeResult]:
        running, name = episode.running, episode.request.episode.agent
        result = running.result(episode.request.episode)
        self._give_back(running.simulator, name, running.agent, result.outcome)
        if not episode.measures_inference:
            versions = {**result.versions, "lockstep": str(width)}
            result = replace(result, wall_s=episode.share_s, versions=versions)
        return episode.request, with_machine(result, self._latest[name], running.simulator)

    def _batch(self, agent: str, width: int) -> Batch:
        return Batch(width, lambda: self._take_agent(agent), self._watch)

    def _take_agent(self, name: str) -> Agent:
        free = self._free_agents.get(name)
        return free.pop() if free else self._made(name)

    def _made(self, name: str) -> Agent:
        self._latest[name] = agent = self._make_agent(name)
        return self._wrap(agent)

    def _take_world(self) -> Simulator:
        if self._free_worlds:
            return self._free_worlds.pop()
        world = self._make_world()
        self._worlds.append(world)
        return world

    def _give_back(self, world: Simulator, name: str, agent: Agent, outcome: Outcome) -> None:
        """Keep what can be used again: what raised in the middle of an episode may be in any state."""
        if outcome is Outcome.INFRA_ERROR:
            self._worlds.remove(world)
            world.close()
            return
        self._free_worlds.append(world)
        if outcome is not Outcome.AGENT_ERROR:
            self._free_agents.setdefault(name, []).append(agent)


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
