"""The executor of agents that are driven in lockstep, in this process or in others."""

from __future__ import annotations

import threading
import typing
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.driver import make_agent
from pytest_drive_robust.runner.executors import InlineExecutor
from pytest_drive_robust.runner.lockstep.lockstep import Lockstep

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.executors import Executor
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import SimulatorOptions

__all__ = ["BatchDriver", "LockstepExecutor", "factory_offers_lockstep", "lockstep_inline"]


class BatchDriver(Protocol):
    """Drives one batch at a time, here (`runner.lockstep.lockstep`) or in a process (`engine.supervisor`)."""

    output: str
    """What was printed by the time of the latest result."""

    def check(self, request: EpisodeRequest) -> bool:
        """Return whether the agent of `request` may be driven in lockstep, False when it broke before it was asked.

        Raises `UsageError` when it must not, or cannot be made.
        """
        ...

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None]
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]:
        """Drive what `take` gives, each with its result as soon as it ends, until none is under way.

        `take` is asked again and again: it may give none now and another one later. No result (None): it wants to be
        driven alone.
        """
        ...

    def drive(self, request: EpisodeRequest) -> EpisodeResult:
        """Drive one in a batch of its own, again when its end was not the agent's doing. Raises `UsageError`."""
        ...

    def stop(self) -> None:
        """Cut off what is under way. From any thread."""
        ...

    def close(self) -> None:
        """Free worlds, agents and processes."""
        ...


class LockstepExecutor:
    """Drives a batch of up to `width` episodes on each driver (see `runner.executors.Executor`).

    Episodes of agents for which `shares(agent)` is false are driven by `one_by_one`, each in the place of a batch.
    `make_drivers` is called at the first episode of another agent. With `threads` each driver works in one of its own;
    without, there is one driver, which works in `work`. Every driver takes what waits whenever it has room.
    """

    def __init__(
        self,
        one_by_one: Executor,
        make_drivers: Callable[[], Sequence[BatchDriver]],
        *,
        width: int,
        shares: Callable[[str], bool],
        threads: int = 0,
        heard: Callable[[EpisodeResult, str], object] = lambda result, output: None,
    ) -> None:
        self._one_by_one = one_by_one
        self._make_drivers = make_drivers
        self._width = width
        self._shares = shares
        self._heard = heard
        self._workers = max(1, threads)
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="drive-robust-lockstep") if threads else None
        self.work = None if threads else self._work
        self._singles: set[Future[EpisodeResult]] = set()
        self._drivers: Sequence[BatchDriver] = ()
        self._steps: Generator[None, None, None] = (None for _ in ())
        self._lock = threading.Lock()
        self._idle: set[BatchDriver] = set()
        self._waiting: list[tuple[EpisodeRequest, Future[EpisodeResult]]] = []
        self._checking = threading.Lock()
        self._refusals: dict[str, UsageError | None] = {}
        self._closed = False

    @property
    def slots(self) -> int:
        """Return how many episodes fit: one that is driven alone takes the place of a batch until it is collected."""
        if self._pool is not None:
            self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    @property
    def compiling(self) -> tuple[int, int]:
        """How many functions are compiled, of how many that episodes wait for."""
        told: tuple[int, int] = getattr(self._one_by_one, "compiling", (0, 0))
        return told

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Let an episode join a batch. Raises `UsageError` when no process could be made like this one."""
        if not self._shares(request.episode.agent):
            single = self._one_by_one.submit(request)
            self._singles.add(single)
            return single
        if not self._drivers:
            self._drivers = self._make_drivers()
            self._idle.update(self._drivers)
            self._steps = self._drive(self._drivers[0])
        future: Future[EpisodeResult] = Future()
        with self._lock:
            self._waiting.append((request, future))
            idle = self._idle.pop() if self._idle and self._pool is not None else None
        if idle is not None and self._pool is not None:
            self._pool.submit(deque, self._drive(idle), maxlen=0)
        return future

    def close(self, *, cancel: bool = False) -> None:
        """Free everything. With `cancel` what is under way is cut off; without, it comes to its end first."""
        if self._closed:
            return
        self._closed = True
        if cancel:
            for driver in self._drivers:
                driver.stop()
        elif self._pool is None:
            deque(self._steps, maxlen=0)
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=cancel)
        self._steps.close()
        for driver in self._drivers:
            driver.close()
        self._one_by_one.close(cancel=cancel)  # last: it may hold what the drivers' processes live in

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, what it printed at its end) of the first episodes that broke since this was asked last."""
        told: Callable[[], tuple[tuple[str, str], ...]] = getattr(self._one_by_one, "last_words", tuple)
        return told()

    def _work(self) -> None:
        """Drive in the caller's thread until an episode has ended or none is left."""
        self._singles.clear()
        for _ in self._steps:
            return
        self._steps = self._drive(self._drivers[0]) if self._drivers else self._steps

    def _drive(self, driver: BatchDriver) -> Generator[None, None, None]:
        """Drive batch after batch until nothing waits; a step for every episode that has ended."""
        while (first := self._first_waiting(driver)) is not None:
            taken: dict[str, Future[EpisodeResult]] = {}
            try:
                yield from self._drive_batch(driver, first, taken)
            except Exception as error:  # `UsageError`, or stopped: whatever it is, nobody may wait for ever
                self._fail(first.episode.agent, taken, error)
                yield

    def _drive_batch(
        self, driver: BatchDriver, first: EpisodeRequest, taken: dict[str, Future[EpisodeResult]]
    ) -> Generator[None, None, None]:
        """Drive `first` and others of its agent. `taken` holds those that have no result yet, by key."""
        alone: list[EpisodeRequest] = []

        def take() -> EpisodeRequest | None:
            with self._lock:
                for number, (request, future) in enumerate(() if alone else self._waiting):
                    if request.episode.agent == first.episode.agent:
                        del self._waiting[number]
                        taken[request.key] = future
                        return request
            return None

        def end(request: EpisodeRequest, result: EpisodeResult | UsageError) -> None:
            future = taken.pop(request.key)
            if isinstance(result, EpisodeResult):
                self._heard(result, driver.output)
                future.set_result(result)
            else:
                future.set_exception(result)

        if not self._may_share(driver, first):
            alone += filter(None, [take()])  # it breaks at once: the next one tells more of its agent
        else:
            for request, result in driver.drive_batch(first.episode.agent, take):
                if result is None or (isinstance(result, EpisodeResult) and result.outcome is Outcome.INFRA_ERROR):
                    alone.append(request)
                else:
                    end(request, result)
                    yield
        for request in alone:
            try:
                end(request, driver.drive(request))
            except UsageError as error:
                end(request, error)
            yield

    def _may_share(self, driver: BatchDriver, first: EpisodeRequest) -> bool:
        """Return whether the agent of `first` may be driven in lockstep, False when that is still unknown.

        It is found out once for all drivers. Raises `UsageError` for one that must not.
        """
        agent = first.episode.agent
        with self._checking:
            if agent not in self._refusals:
                try:
                    if not driver.check(first):
                        return False
                    self._refusals[agent] = None
                except UsageError as error:
                    self._refusals[agent] = error
        refusal = self._refusals[agent]
        if refusal is not None:
            raise refusal
        return True

    def _first_waiting(self, driver: BatchDriver) -> EpisodeRequest | None:
        with self._lock:
            if not self._waiting:
                self._idle.add(driver)
            return self._waiting[0][0] if self._waiting else None

    def _fail(self, agent: str, taken: dict[str, Future[EpisodeResult]], error: Exception) -> None:
        """End whatever is known of this agent without a result."""
        with self._lock:
            lost = [future for request, future in self._waiting if request.episode.agent == agent]
            self._waiting = [item for item in self._waiting if item[0].episode.agent != agent]
        for future in (*taken.values(), *lost):
            future.set_exception(error)


def lockstep_inline(
    registry: Registry, *, simulator: str, options: SimulatorOptions, ticked: Callable[[], object], width: int
) -> LockstepExecutor:
    """Return the executor of lockstep in this process, where nothing protects the run from the agent.

    `ticked` is called after every tick of each episode.
    """
    driver = Lockstep(
        lambda: registry.simulator(simulator, options),
        lambda name: make_agent(registry, name),
        width=width,
        on_tick=lambda *_: ticked(),
    )
    return LockstepExecutor(
        InlineExecutor(registry, simulator=simulator, options=options, ticked=ticked),
        lambda: [driver],
        width=width,
        shares=lambda agent: factory_offers_lockstep(agent, registry),
    )


def factory_offers_lockstep(agent: str, registry: Registry) -> bool:
    """Return whether what makes the agent has an `act_batch`, or says that it returns a class that has one.

    No agent is made: that belongs in the process that drives it. Raises `UnknownNameError` or `PluginError`.
    """
    factory = registry.entry("agents", agent).load()
    if callable(getattr(factory, "act_batch", None)):
        return True
    try:
        made = typing.get_type_hints(factory).get("return")
    except Exception:  # an annotation that names something imported for type checkers only, or no function at all
        return False
    return callable(getattr(made, "act_batch", None))
