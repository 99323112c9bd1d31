"""Who turns requests into finished episodes: the protocol, and the executor of this machine, here or in processes."""

from __future__ import annotations

import functools
import threading
import typing
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import SimulatorOptions

__all__ = ["Driver", "Executor", "InlineExecutor", "LocalExecutor", "factory_offers_lockstep"]

_MOST_WORDS = 2000
"""Characters of what a broken episode printed that are kept for people."""
_MOST_EPISODES = 5


class Executor(Protocol):
    """Drives episodes, at most `slots` at a time.

    An episode that breaks is a result too (`agent_error`, `infra_error`): the only exceptions of a future are
    `UsageError`, when the agent or the simulator cannot be made at all, and `Stopped`, when `close` cut it off.

    An executor that drives in the thread of its caller has a `work()`, too: it is called while somebody waits, again
    and again, and returns when something has ended or nothing is left to drive.

    An executor whose episodes may wait for a compiler says in `compiling` how many functions are compiled, of how many.
    """

    @property
    def slots(self) -> int:
        """Return how many episodes it can drive at this moment."""
        ...

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Begin an episode. The caller keeps to `slots`."""
        ...

    def close(self, *, cancel: bool = False) -> None:
        """Free simulators, agents and processes. With `cancel`, what is under way is cut off and has no result.

        Calling it twice does no harm.
        """
        ...


class Driver(Protocol):
    """Drives one episode or one batch at a time, here (`EpisodeDriver`) or in a process (`engine.supervisor`)."""

    output: str
    """What was printed by the time of the latest result."""

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive one, by `act` or with a `width` in a batch of its own; again when its end was not the agent's doing.

        Raises `UsageError`, `Stopped`.
        """
        ...

    def check(self, request: EpisodeRequest, width: int) -> bool:
        """Return whether the agent of `request` may be driven in lockstep, False when it broke before it was asked.

        Raises `UsageError` when it must not, or cannot be made.
        """
        ...

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None], width: int
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]:
        """Drive what `take` gives, up to `width` at once, each with its result as soon as it ends, until none is left.

        `take` is asked again and again: it may give none now and another one later. No result (None): it wants to be
        driven alone.
        """
        ...

    def stop(self) -> None:
        """Cut off what is under way. From any thread."""
        ...

    def close(self) -> None:
        """Free worlds, agents and processes."""
        ...


class LocalExecutor:
    """Has drivers take what waits: an episode, or with a `width` a batch of up to so many of an agent that `shares`.

    With `threads` there are so many drivers, each in a thread of its own; without there is one, which works in `work`.
    They are made at the first episode.
    """

    def __init__(
        self, *, threads: int = 0, width: int | None = None, shares: Callable[[str], bool] = lambda agent: False
    ) -> None:
        self._width = width or 1
        self._shares = shares
        self._workers = max(1, threads)
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="drive-robust") if threads else None
        self.work = None if threads else self._work
        self._singles: set[Future[EpisodeResult]] = set()
        self._drivers: Sequence[Driver] = ()
        self._steps: Generator[None, None, None] = (None for _ in ())
        self._lock = threading.Lock()
        self._idle: set[Driver] = set()
        self._waiting: list[tuple[EpisodeRequest, Future[EpisodeResult]]] = []
        self._checking = threading.Lock()
        self._refusals: dict[str, UsageError | None] = {}
        self._words: list[tuple[str, str]] = []
        self._closed = False

    def make_drivers(self) -> Sequence[Driver]:
        """Return one driver for each thread. Raises `UsageError` where no process could be made like this one."""
        raise NotImplementedError

    @property
    def slots(self) -> int:
        """Return how many episodes fit: one that is driven alone takes the place of a batch."""
        self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Let the next free driver have an episode. Raises `UsageError` as `make_drivers`."""
        if not self._drivers:
            self._drivers = self.make_drivers()
            self._idle.update(self._drivers)
        future: Future[EpisodeResult] = Future()
        if self._width > 1 and not self._shares(request.episode.agent):
            self._singles.add(future)
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
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=cancel)
        elif not cancel:
            while self._waiting:
                self._work()
            deque(self._steps, maxlen=0)
        self._steps.close()
        for driver in self._drivers:
            driver.close()

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, what it printed at its end) of the first episodes that broke since this was asked last."""
        with self._lock:
            words, self._words = tuple(self._words), []
        return words

    def _work(self) -> None:
        """Drive in the caller's thread until an episode has ended or none is left."""
        for _ in self._steps:
            return
        self._steps = self._drive(self._drivers[0]) if self._drivers else self._steps
        next(self._steps, None)

    def _drive(self, driver: Driver) -> Generator[None, None, None]:
        """Drive what waits until nothing does; a step for every episode that has ended."""
        while (first := self._first_waiting(driver)) is not None:
            taken: dict[str, Future[EpisodeResult]] = {}
            try:
                yield from self._drive_first(driver, first, taken)
            except Exception as error:  # `UsageError`, or stopped: whatever it is, nobody may wait for ever
                self._fail(first.episode.agent, taken, error)
                yield

    def _drive_first(
        self, driver: Driver, first: EpisodeRequest, taken: dict[str, Future[EpisodeResult]]
    ) -> Generator[None, None, None]:
        """Drive `first`, with others of its agent where it shares. `taken` are those without a result yet, by key."""
        agent, alone = first.episode.agent, [first]
        width = self._width if self._width > 1 and self._shares(agent) else None

        def take() -> EpisodeRequest | None:
            with self._lock:
                if width is not None and any(future in self._singles for _, future in self._waiting):
                    return None  # a batch that never ends would keep them waiting
                for number, (request, future) in enumerate(self._waiting):
                    if request.episode.agent == agent:
                        del self._waiting[number]
                        taken[request.key] = future
                        return request
            return None

        if width is None or not self._may_share(driver, first, width):
            request = take()  # one that breaks at once says nothing of its agent: the next one tells more
            alone = [] if request is None else [request]
        else:
            alone = []
            for request, result in driver.drive_batch(agent, take, width):
                if result is None or (isinstance(result, EpisodeResult) and result.outcome is Outcome.INFRA_ERROR):
                    alone.append(request)
                else:
                    self._end(driver, taken.pop(request.key), result)
                    yield
        for request in alone:
            try:
                found: EpisodeResult | UsageError = driver.drive(request, width)
            except UsageError as error:
                found = error
            self._end(driver, taken.pop(request.key), found)
            yield

    def _end(self, driver: Driver, future: Future[EpisodeResult], result: EpisodeResult | UsageError) -> None:
        """Give somebody who waits a result; keep what a broken episode printed, for people."""
        if isinstance(result, UsageError):
            future.set_exception(result)
            return
        printed = driver.output.strip()
        if printed and result.outcome in (Outcome.AGENT_ERROR, Outcome.INFRA_ERROR):
            shown = printed if len(printed) <= _MOST_WORDS else f"...{printed[-_MOST_WORDS:]}"
            with self._lock:
                if len(self._words) < _MOST_EPISODES:
                    self._words.append((str(result.episode), shown))
        future.set_result(result)

    def _may_share(self, driver: Driver, first: EpisodeRequest, width: int) -> bool:
        """Return whether the agent of `first` may be driven in lockstep, False when that is still unknown.

        It is found out once for all drivers. Raises `UsageError` for one that must not.
        """
        agent = first.episode.agent
        with self._checking:
            if agent not in self._refusals:
                try:
                    if not driver.check(first, width):
                        return False
                    self._refusals[agent] = None
                except UsageError as error:
                    self._refusals[agent] = error
        refusal = self._refusals[agent]
        if refusal is not None:
            raise refusal
        return True

    def _first_waiting(self, driver: Driver) -> EpisodeRequest | None:
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


class InlineExecutor(LocalExecutor):
    """Drives in this process, for debuggers and prints: nothing protects the run from the agent.

    `ticked` is called after every tick of each episode. With a `width` agents that offer it are driven in lockstep.
    """

    def __init__(
        self,
        registry: Registry,
        *,
        simulator: str,
        options: SimulatorOptions,
        ticked: Callable[[], object],
        width: int | None = None,
    ) -> None:
        super().__init__(width=width, shares=lambda agent: factory_offers_lockstep(agent, registry))
        self._simulator = simulator
        self._driver = EpisodeDriver(
            lambda: registry.simulator(simulator, options),
            lambda name: make_agent(registry, name),
            on_tick=lambda *_: ticked(),
        )

    def make_drivers(self) -> Sequence[Driver]:
        """Return the one of this process."""
        return [self._driver]

    @functools.cached_property
    def compiling(self) -> tuple[int, int]:
        """Of the functions of the embedded world that were in no cache when this was first asked, none is compiled."""
        if self._simulator == "embedded":
            with suppress(ImportError):  # the episode says so
                from pytest_drive_robust.simulators.embedded.compiling import missing_functions  # loads numba

                return 0, missing_functions()
        return 0, 0


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
