"""Lockstep in this process: episodes are collected, and driven together while the scheduler waits."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.generators import borrowed_for
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.executors import DRIVEN_AGAIN, InlineExecutor
from pytest_drive_robust.runner.lockstep.lockstep import Lockstep
from pytest_drive_robust.runner.lockstep.vetting import factory_offers_lockstep, refused, vet

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions

__all__ = ["InlineLockstepExecutor"]


class InlineLockstepExecutor:
    """Drives agents that offer `act_batch` up to `width` at a time (see `runner.executors.Executor`), others alone.

    Nothing protects the run from the agent. `ticked` is called after every tick of all that are driven together.
    """

    def __init__(
        self,
        registry: Registry,
        *,
        simulator: str,
        options: SimulatorOptions,
        ticked: Callable[[], object],
        width: int,
    ) -> None:
        self._registry = registry
        self._make_world: Callable[[], Simulator] = lambda: registry.simulator(simulator, options)
        self._ticked = ticked
        self._width = width
        self._one_by_one = InlineExecutor(registry, simulator=simulator, options=options, ticked=ticked)
        self._drove_one = False
        self._futures: dict[str, tuple[EpisodeRequest, Future[EpisodeResult]]] = {}
        self._waiting: list[EpisodeRequest] = []
        self._agent: str | None = None
        self._sample: Agent | None = None
        self._lockstep: Lockstep | None = None
        self._driving: Generator[tuple[EpisodeRequest, EpisodeResult], None, None] | None = None
        self._refused: dict[str, UsageError] = {}
        self._passed: set[str] = set()

    @property
    def slots(self) -> int:
        """As many as share a batch; one while an episode that was driven alone has not been collected."""
        return 1 if self._drove_one else self._width

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """The episode of an agent without `act_batch` is driven at once, others by `work`."""
        if not factory_offers_lockstep(request.episode.agent, self._registry):
            self._drove_one = True
            return self._one_by_one.submit(request)
        future: Future[EpisodeResult] = Future()
        self._futures[request.key] = request, future
        self._waiting.append(request)
        return future

    def work(self) -> None:
        """Drive together what was submitted, until one of the episodes has ended."""
        self._drove_one = False
        if self._driving is None and self._waiting:
            self._agent = self._waiting[0].episode.agent
            try:
                self._driving = self._begin(self._agent)
            except UsageError as error:
                self._fail(self._agent, error)
        if self._driving is None:
            return
        try:
            with self._seeded():
                request, result = next(self._driving)
        except StopIteration:
            self._driving = None
        except UsageError as error:
            self._driving = None
            self._fail(self._agent, error)
        except BaseException:
            self._driving = None
            raise
        else:
            future = self._futures.pop(request.key)[1]
            future.set_result(self._final(request, result))

    def close(self, *, cancel: bool = False) -> None:
        """Close the simulators and drop the agents; without `cancel`, what was submitted is driven first."""
        while not cancel and self._futures:
            self.work()
        self._stop()
        self._one_by_one.close(cancel=cancel)

    def _begin(self, agent: str) -> Generator[tuple[EpisodeRequest, EpisodeResult], None, None]:
        """The drive of everything of this agent that waits, or will before it ends. Raises `UsageError`."""
        if self._lockstep is None or self._lockstep.agent_name not in (None, agent):
            self._stop()
            self._lockstep = Lockstep(self._make_world, self._make_agent, width=self._width, ticked=self._ticked)
        first = self._waiting[0]
        if self._may_share(agent, first):
            return self._lockstep.drive(_Waiting(agent, self._waiting))
        self._waiting.remove(first)  # the agent breaks in it at once: it is asked about the next one
        return self._lockstep.drive([first])

    def _final(self, request: EpisodeRequest, result: EpisodeResult) -> EpisodeResult:
        """The result, of another try where the world broke."""
        assert self._lockstep is not None
        for _ in range(DRIVEN_AGAIN):
            if result.outcome is Outcome.INFRA_ERROR:
                with self._seeded():
                    ((_, result),) = self._lockstep.drive([request])
        return with_machine(result, self._sample)

    def _make_agent(self) -> Agent:
        assert self._agent is not None
        agent = self._sample = make_agent(self._registry, self._agent)
        return agent

    def _seeded(self) -> AbstractContextManager[None]:
        """Around everything that runs code of the agent: the global generators of this process are not ours."""
        assert self._agent is not None
        return borrowed_for(Episode(self._agent, "", "", 0))

    def _may_share(self, agent: str, request: EpisodeRequest) -> bool:
        """False when the episode has nothing to ask about. Raises `UsageError` for an agent that is refused."""
        if agent in self._passed:
            return True
        if agent in self._refused:
            raise self._refused[agent]
        world = self._make_world()
        try:
            with self._seeded():
                vetting = vet(world, self._make_agent, request, width=self._width)
        finally:
            world.close()
        if vetting.problem is not None:
            self._refused[agent] = refused(agent, vetting.problem)
            raise self._refused[agent]
        if vetting.passed:
            self._passed.add(agent)
        return vetting.passed

    def _fail(self, agent: str | None, error: UsageError) -> None:
        """Nothing of this agent can be driven."""
        for key, (request, future) in tuple(self._futures.items()):
            if request.episode.agent == agent:
                del self._futures[key]
                future.set_exception(error)
        self._waiting[:] = [request for request in self._waiting if request.episode.agent != agent]

    def _stop(self) -> None:
        if self._driving is not None:
            self._driving.close()
            self._driving = None
        if self._lockstep is not None:
            self._lockstep.close()
        self._lockstep = self._sample = None


class _Waiting:
    """The requests of one agent, taken from a list that grows: there may be none now and another one later."""

    def __init__(self, agent: str, requests: list[EpisodeRequest]) -> None:
        self._agent = agent
        self._requests = requests

    def __iter__(self) -> Iterator[EpisodeRequest]:
        return self

    def __next__(self) -> EpisodeRequest:
        for number, request in enumerate(self._requests):
            if request.episode.agent == self._agent:
                return self._requests.pop(number)
        raise StopIteration
