"""Drives episodes in one process, with its worlds and its agents; the only place where an agent is made.

An episode is driven by the agent's `act`, or in lockstep: side by side with other episodes of an agent that answers
many observations in one call (`act_batch`). In lockstep every episode has its own world and agent object. A batch has
one of a few fixed sizes: when fewer episodes ask, stand-ins fill its rows, because the bits of a matrix product depend
on its shape. With one thread, and after `check_lockstep` passed, an episode is the same to the last bit, whichever
episodes share the batch, in any order, and however early they end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import AgentError, UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.declared import require_declared
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.runner.lockstep.batch import ROWS, WIDTH, Batch
from pytest_drive_robust.runner.lockstep.check import admit
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator

_Ended = Generator[tuple[EpisodeRequest, EpisodeResult], None, None]
DRIVEN_AGAIN = 2
"""How many more times an episode is driven when its end is not the agent's fault."""


class EpisodeDriver:
    """Drives episodes; reuses worlds and agent objects from episode to episode, and replaces those that broke.

    `make_agent` takes a name. `watch` is told whose code runs; in lockstep it gets the tick of the first row.
    """

    output = ""

    def __init__(
        self, make_world: Callable[[], Simulator], make_agent: Callable[[str], Agent], *, watch: Watch | None = None
    ) -> None:
        self._make_world = make_world
        self._make_agent = make_agent
        self._watch = watch or Watch()
        self._worlds: list[Simulator] = []
        self._free_worlds: list[Simulator] = []
        self._free_agents: dict[str, list[Agent]] = {}
        self._refusals: dict[str, UsageError | None] = {}  # results of the lockstep check, by agent

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive an episode as `drive_once` does; drive it again, at most twice, when the world broke."""
        for _ in range(1 + DRIVEN_AGAIN):
            result = self.drive_once(request, width)
            if result.outcome is not Outcome.INFRA_ERROR:
                break
        return result

    def drive_once(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive an episode by `act`, or with `width` in its own batch, so that an error in the batch is its agent's.

        A setting that measures the inference time is always driven by `act`, because a batch has no time per row.
        Raises `UsageError` when the world or the agent cannot be made.
        """
        agent = request.episode.agent
        if width is None or request.setting.measures_inference:
            with borrowed_generators(repr(request.episode)), self._closing_cut_off():
                running = self._running(request)
                running.drive()
                return self._result(request, running)
        with borrowed_generators(f"driving {agent}"), self._closing_cut_off():
            running, batch = self._begin(request), Batch(width, lambda: self._take_agent(agent), self._watch)
            while not running.over:
                running.attempt(lambda: self._round([running], batch))
            self._free_agents.setdefault(agent, []).extend(batch.give_back())
            return self._end(request, running, width)

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None], width: int = WIDTH, *, check: bool = True
    ) -> _Ended:
        """Drive up to `width` episodes at once; yield (request, result) for each as soon as it ends.

        `take` is called when a row is free, not before. A result has `lockstep=8` (the width) in `versions`, and its
        `wall_s` is the episode's share of the batch's time. With `check`, test once whether the agent may be driven in
        lockstep (`admit`).

        Raises `UsageError` when the agent cannot be made or must not be driven in lockstep, and `ValueError` for a
        width that is no positive multiple of four and for two agents in a batch. Errors of the agent, the world or a
        perturbation end the episode, as in `drive_episode`. When a whole batch breaks, its episodes are driven again
        one by one, so that only the episode at fault ends in `agent_error`.
        """
        if width < ROWS or width % ROWS:
            raise ValueError(f"the width of lockstep is {width}, expected a multiple of {ROWS} such as {WIDTH}")
        self._free_agents = {agent: self._free_agents.get(agent, [])}  # free the many objects of another agent's batch
        driving = self._drive_together(agent, take, width, check=check)
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
        """Return a world; make one when there is none yet."""
        if not self._worlds:
            self._free_worlds.append(self._take_world())
        return self._worlds[0]

    def close(self) -> None:
        """Close the worlds and drop the agents. A second call does nothing."""
        for world in self._worlds:
            world.close()
        self._worlds.clear()
        self._free_worlds.clear()
        self._free_agents.clear()

    def _drive_together(
        self, agent: str, take: Callable[[], EpisodeRequest | None], width: int, *, check: bool
    ) -> _Ended:
        live: dict[RunningEpisode, EpisodeRequest] = {}
        batch = Batch(width, lambda: self._take_agent(agent), self._watch)
        with self._closing_cut_off():
            with suppress(GeneratorExit):  # the caller stops between two ticks: the worlds can be reused
                while True:
                    while len(live) < width and (request := take()) is not None:
                        if request.episode.agent != agent:
                            raise ValueError(f"{request.episode} cannot share a batch with episodes of {agent}")
                        if request.setting.measures_inference or (check and not self._may_share(request, width)):
                            yield request, self.drive_once(request, width)
                        else:
                            live[self._begin(request)] = request
                    if not live:
                        break
                    broken: list[EpisodeRequest] = []
                    try:
                        self._round(live, batch)
                    except AgentError:  # the episode at fault is unknown
                        spoilt = [running for running in live if not running.over]
                        self._free_worlds += [running.simulator for running in spoilt]
                        broken = [live.pop(running) for running in spoilt]
                    over = [(live.pop(running), running) for running in tuple(live) if running.over]
                    yield from [(request, self._end(request, running, width)) for request, running in over]
                    for request in broken:
                        yield request, self.drive_once(request, width)
            self._free_agents.setdefault(agent, []).extend(batch.give_back())
            self._free_worlds += [running.simulator for running in live]

    def _may_share(self, request: EpisodeRequest, width: int) -> bool:
        """Return whether the agent may be driven in lockstep; False while the check has seen nothing.

        Raises `UsageError` for an agent that must not be driven in lockstep, or that cannot be made.
        """
        name = request.episode.agent
        if name not in self._refusals:
            world = self._make_world()
            try:
                if not admit(world, lambda: self._make_agent(name), request, width=width, watch=self._watch):
                    return False
                self._refusals[name] = None
            except UsageError as error:
                self._refusals[name] = error
            finally:
                world.close()
        refusal = self._refusals[name]
        if refusal is not None:
            raise refusal
        return True

    def _round(self, live: Collection[RunningEpisode], batch: Batch) -> None:
        """Drive one tick of every episode. Raises `AgentError` when the whole batch broke."""
        started_s = time.perf_counter()
        driven = [running for running in live if not running.over]
        asked = [(running, given) for running in driven if (given := running.attempt(running.sense)) is not None]
        try:
            if asked:
                answers, inference_s = batch.ask(asked)
                for (running, _), answer in zip(asked, answers, strict=True):
                    running.attempt(partial(running.advance, answer, inference_s))
        finally:
            share_s = (time.perf_counter() - started_s) / len(live)
            for running in live:
                running.share_s += share_s

    def _running(self, request: EpisodeRequest) -> RunningEpisode:
        world, agent = self._take_world(), self._take_agent(request.episode.agent)
        return RunningEpisode(world, agent, request.route, request.setting, request.episode.seed, watch=self._watch)

    def _begin(self, request: EpisodeRequest) -> RunningEpisode:
        running = self._running(request)
        running.attempt(running.start)
        running.share_s = time.perf_counter() - running.started_s
        return running

    def _end(self, request: EpisodeRequest, running: RunningEpisode, width: int) -> EpisodeResult:
        result = self._result(request, running)
        return replace(result, versions={**result.versions, "lockstep": str(width)})

    def _result(self, request: EpisodeRequest, running: RunningEpisode) -> EpisodeResult:
        """Return the result of an episode; keep its world and agent for reuse, unless an error broke their state."""
        result, world = running.result(request.episode), running.simulator
        if result.outcome is Outcome.INFRA_ERROR:
            self._worlds = [one for one in self._worlds if one is not world]
            world.close()
        else:
            self._free_worlds.append(world)
            if result.outcome is not Outcome.AGENT_ERROR:
                self._free_agents.setdefault(request.episode.agent, []).append(running.agent)
        return with_machine(result, running.agent, world)

    @contextmanager
    def _closing_cut_off(self) -> Iterator[None]:
        """Close the worlds in use when the body raises: they may be in the middle of a tick."""
        try:
            yield
        except BaseException:
            free = set(map(id, self._free_worlds))
            in_use = [world for world in self._worlds if id(world) not in free]
            self._worlds = list(self._free_worlds)
            for world in in_use:
                with suppress(Exception):  # the first error is the one to report
                    world.close()
            raise

    def _take_agent(self, name: str) -> Agent:
        free = self._free_agents.get(name)
        return free.pop() if free else self._make_agent(name)

    def _take_world(self) -> Simulator:
        if self._free_worlds:
            return self._free_worlds.pop()
        world = self._make_world()
        self._worlds.append(world)
        return world


def make_agent(registry: Registry, name: str) -> Agent:
    """Make the agent `name`; every call makes an equal agent, whatever random numbers its constructor draws.

    The global generators are seeded by the agent's name while the agent is made. The episode is no part of the seed:
    one agent object drives many episodes, and which comes first depends on the order, the number of processes and the
    store. An agent made anew after an error must equal the one that it replaces. Raises `UsageError` when the agent
    cannot be made, or declares an attribute of its keys that its factory does not declare.
    """
    with borrowed_generators(f"making {name}"):
        agent = registry.agent(name)
    require_declared(name, agent, registry.entry("agents", name).load())
    return agent
