"""What drives episodes in one process: its worlds and its agents, and the one place where an agent is made.

An episode is driven by the agent's own `act`, or side by side with others of its agent that answers many observations
in one call (`act_batch`): in lockstep. There every episode has a world and an agent object of its own. A batch always
has the same number of rows: where fewer episodes ask, stand-ins fill it, because the bits of a matrix product depend on
its shape. With one thread and `check_lockstep` passed, an episode comes out the same to the last bit whoever shares the
batch with it, in whichever order, and however early the others end.
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
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.runner.episode.loop import RunningEpisode, Watch
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.lockstep.batch import ROWS, WIDTH, Batch, admit
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator

_Ended = Generator[tuple[EpisodeRequest, EpisodeResult], None, None]
DRIVEN_AGAIN = 2
"""How often an episode is driven again when its end was not the agent's doing."""


class EpisodeDriver:
    """Worlds and agent objects serve one episode after the other; what broke in one of them is made anew.

    `make_agent` is given a name. `watch` is told whose code runs; in lockstep its tick is that of the first row.
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
        self._refusals: dict[str, UsageError | None] = {}  # of agents that were checked for lockstep

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive an episode as `drive_once` does; again where the world broke."""
        for _ in range(1 + DRIVEN_AGAIN):
            result = self.drive_once(request, width)
            if result.outcome is not Outcome.INFRA_ERROR:
                break
        return result

    def drive_once(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive an episode by `act`, with a `width` in a batch of its own: what breaks that is its agent's fault.

        A setting that measures the time of inference is driven by `act`, as a batch has no time per row. Raises
        `UsageError` when the world or the agent cannot be made.
        """
        agent = request.episode.agent
        if width is None or _measures_inference(request):
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
        """Drive up to `width` episodes at once; yield each with its result as soon as it ends.

        One is taken when a place is free, not before. A result says `lockstep=8` in `versions`, and its `wall_s` is the
        episode's share of the time that all took. `check`: ask once whether the agent may be driven so (`admit`).

        Raises `UsageError` when the agent cannot be made or must not be driven so, `ValueError` for a width that is no
        positive multiple of four and for two agents in a batch, and never for what agent, world or perturbations do:
        see `drive_episode` for how that ends. When a whole batch breaks, its episodes begin again one by one, so that
        only the guilty one ends in `agent_error`.
        """
        if width < ROWS or width % ROWS:
            raise ValueError(f"the width of lockstep is {width}, expected a multiple of {ROWS} such as {WIDTH}")
        self._free_agents = {agent: self._free_agents.get(agent, [])}  # a batch of another one holds many objects
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
        """Return a world, made when there is none yet."""
        if not self._worlds:
            self._free_worlds.append(self._take_world())
        return self._worlds[0]

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
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
            with suppress(GeneratorExit):  # the caller wants no more of them: nobody is in the middle of a tick
                while True:
                    while len(live) < width and (request := take()) is not None:
                        if request.episode.agent != agent:
                            raise ValueError(f"{request.episode} cannot share a batch with episodes of {agent}")
                        if _measures_inference(request) or (check and not self._may_share(request, width)):
                            yield request, self.drive_once(request, width)
                        else:
                            live[self._begin(request)] = request
                    if not live:
                        break
                    broken: list[EpisodeRequest] = []
                    try:
                        self._round(live, batch)
                    except AgentError:  # nobody knows by whose fault
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
        """Return whether the agent may be driven in lockstep, False while that is not known.

        Raises `UsageError` for one that must not, or that cannot be made.
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
        """Return what came of an episode; keep what can be used again, and nothing that may be in any state."""
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
        """Close what worlds are in use when something is raised: they may be in the middle of a tick."""
        try:
            yield
        except BaseException:
            free = set(map(id, self._free_worlds))
            in_use = [world for world in self._worlds if id(world) not in free]
            self._worlds = list(self._free_worlds)
            for world in in_use:
                with suppress(Exception):  # told is what cut it off
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


def _measures_inference(request: EpisodeRequest) -> bool:
    """Return whether the setting needs the seconds of one call of `act`, which no row of a batch has."""
    return any(getattr(item, "measures_inference", False) for item in request.setting.perturbations)


def make_agent(registry: Registry, name: str) -> Agent:
    """Build the agent of that name; the same object every time, whatever its constructor draws.

    The global generators are seeded by the agent's name alone meanwhile. Not by the episode: one object is kept for
    many, and which of them comes first depends on the order, the number of processes and what is stored already. One
    that is made anew after an error must be the one that it replaces. Raises `UsageError` when it cannot be made.
    """
    with borrowed_generators(f"making {name}"):
        return registry.agent(name)
