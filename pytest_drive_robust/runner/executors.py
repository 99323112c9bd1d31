"""Who turns requests into finished episodes: the base class, and the executor of this machine, here or in processes."""

from __future__ import annotations

import functools
import threading
import typing
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Protocol

from pytest_drive_robust.domain.agent import Agent, offers_lockstep
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions

_MOST_WORDS = 2000
"""Characters of what a broken episode printed that are kept for people."""
_MOST_EPISODES = 5


class Executor(ABC):
    """Drives episodes, at most `slots` at a time."""

    work: Callable[[], object] | None = None
    """Drives in the thread of its caller until something has ended or nothing is left; None where others drive.

    It is called again and again while somebody waits.
    """

    @property
    @abstractmethod
    def slots(self) -> int:
        """Return how many episodes it can drive at this moment."""

    @abstractmethod
    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Begin an episode. The caller keeps to `slots`.

        An episode that breaks is a result too (`agent_error`, `infra_error`): the only exceptions of the future are
        `UsageError`, when the agent or the simulator cannot be made at all, and `Stopped`, when `close` cut it off.
        """

    def finished(self, request: EpisodeRequest) -> EpisodeResult | None:
        """Return an episode that `submit` would not drive, as it is kept where the executor looks; else None.

        Raises `UsageError` where what is kept cannot be used.
        """
        return None

    @abstractmethod
    def close(self) -> None:
        """Free simulators, agents and processes; what is under way has no result. Calling it twice does no harm."""

    @property
    def compiling(self) -> tuple[int, int]:
        """Return how many functions are compiled, of how many that episodes may wait for."""
        return 0, 0

    def drives(self, agent: str) -> bool:
        """Return whether an agent need not wait for a compiler."""
        return True

    def together(self, agent: str) -> int:
        """Return how many episodes of an agent share a driver, and its time: more than one in lockstep."""
        return 1

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, what it printed at its end) of the first episodes that broke since this was asked last."""
        return ()


class Driver(Protocol):
    """Drives one episode or one batch at a time, here (`EpisodeDriver`) or in a process (`engine.supervisor`).

    `output` is what was printed by the time of the latest result. Methods raise `UsageError`, `Stopped`.
    """

    output: str

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive one, by `act` or with a `width` in a batch of its own; again when its end was not the agent's doing."""

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None], width: int
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]:
        """Drive up to `width` at once, each with its result as soon as it ends; what has none is to be driven alone.

        `take` is asked again and again: it may give none now and another one later.
        """

    def close(self) -> None:
        """Free worlds, agents and processes."""


class LocalExecutor(Executor):
    """Has drivers take what waits: an episode, or with a `width` a batch of up to so many of an agent that `shares`.

    With `threads` there are so many drivers, each in a thread of its own; without there is one, which works in `work`.
    `make_drivers(agent)` is called at the first episode, which is one of `agent`, and raises `UsageError` where no
    process could be made like this one.
    """

    def __init__(
        self,
        make_drivers: Callable[[str], Sequence[Driver]],
        *,
        threads: int = 0,
        width: int | None = None,
        shares: Callable[[str], bool] = lambda agent: False,
    ) -> None:
        self._make_drivers = make_drivers
        self._width = width or 1
        self._shares = shares
        self._workers = max(1, threads)
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="drive-robust") if threads else None
        self.work = None if threads else self._work
        self._singles: set[Future[EpisodeResult]] = set()
        self._drivers: Sequence[Driver] = ()
        self._steps: Generator[None, None, None] = (None for _ in ())
        self._lock = threading.Lock()
        self._idle: list[Driver] = []
        self._waiting: list[tuple[EpisodeRequest, Future[EpisodeResult]]] = []
        self._batches: list[dict[str, Future[EpisodeResult]]] = []
        self._yielding: dict[str, Future[EpisodeResult]] | None = None
        self._words: list[tuple[str, str]] = []

    @property
    def slots(self) -> int:
        """Return how many episodes fit: one that is driven alone takes the place of a batch."""
        self._singles = {future for future in self._singles if not future.done()}
        return self._workers * self._width - (self._width - 1) * len(self._singles)

    def together(self, agent: str) -> int:
        """Return the width of batches for an agent that shares them, else 1."""
        return self._width if self._width > 1 and self._shares(agent) else 1

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Let the next free driver have an episode. Raises `UsageError` as `make_drivers`."""
        if not self._drivers:
            self._drivers = self._make_drivers(request.episode.agent)
            self._idle += self._drivers
        future: Future[EpisodeResult] = Future()
        with self._lock:
            if self._width > 1 and self.together(request.episode.agent) == 1:
                self._singles.add(future)
            self._waiting.append((request, future))
        if self._pool is not None:
            self._pool.submit(self._drive_in_thread)
        return future

    def close(self) -> None:
        """Wait for what is under way, and free everything."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
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

    def _drive_in_thread(self) -> None:
        driver = self._idle.pop()  # there are as many as threads
        deque(self._drive(driver), maxlen=0)
        self._idle.append(driver)

    def _drive(self, driver: Driver) -> Generator[None, None, None]:
        """Drive what waits until nothing does; a step for every episode that has ended."""
        while (first := self._first()) is not None:
            taken: dict[str, Future[EpisodeResult]] = {}
            try:
                yield from self._drive_first(driver, first, taken)
            except Exception as error:  # `UsageError`, or stopped: whatever it is, nobody may wait for ever
                self._fail(first.episode.agent, taken, error)
                yield
            finally:
                for future in taken.values():  # a test was interrupted, as by a timeout: later ones may drive it anew
                    future.cancel()
                with self._lock:
                    self._batches = [batch for batch in self._batches if batch is not taken]
                    if self._yielding is taken:
                        self._yielding = None

    def _first(self) -> EpisodeRequest | None:
        """Return what is driven next: one that is driven alone, as no batch grows while it waits, else the oldest."""
        waiting = tuple(self._waiting)
        alone = (request for request, future in waiting if future in self._singles)
        return next(alone, waiting[0][0] if waiting else None)

    def _drive_first(
        self, driver: Driver, first: EpisodeRequest, taken: dict[str, Future[EpisodeResult]]
    ) -> Generator[None, None, None]:
        """Drive `first`, with others of its agent where it shares. `taken` are those without a result yet, by key."""
        agent = first.episode.agent
        width = self._width if self.together(agent) > 1 else None
        if width is not None:
            with self._lock:
                self._batches.append(taken)

        def take() -> EpisodeRequest | None:
            with self._lock:
                if width is not None and (self._yields(agent, taken) or len(taken) >= self._share()):
                    return None
                for number, (request, future) in enumerate(self._waiting):
                    if request.episode.agent == agent:
                        taken[request.key] = future
                        del self._waiting[number]
                        return request
            return None

        alone: list[EpisodeRequest] = []
        for request, result in () if width is None else driver.drive_batch(agent, take, width):
            if result is None or (isinstance(result, EpisodeResult) and result.outcome is Outcome.INFRA_ERROR):
                alone.append(request)
            else:
                self._end(driver, taken.pop(request.key), result)
                yield
        if width is None and (single := take()) is not None:
            alone.append(single)
        for request in alone:
            try:
                found: EpisodeResult | UsageError = driver.drive(request, width)
            except UsageError as error:
                found = error
            self._end(driver, taken.pop(request.key), found)
            yield

    def _yields(self, agent: str, taken: dict[str, Future[EpisodeResult]]) -> bool:
        """Return whether a batch takes no more, as an episode that cannot join waits for its driver to be free.

        One batch at a time does: with all of them a single such episode would empty every driver.
        """
        first = self._first()
        if first is None or first.episode.agent == agent:
            if self._yielding is taken:
                self._yielding = None
        elif self._yielding is None:
            self._yielding = taken
        return self._yielding is taken

    def _share(self) -> int:
        """Return how many episodes a batch may hold, so that none holds eight while other drivers have nothing."""
        alone = sum(not future.done() for future in self._singles)
        unfinished = len(self._waiting) + sum(map(len, self._batches))
        return -(-unfinished // max(1, self._workers - alone))

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

    def _fail(self, agent: str, taken: dict[str, Future[EpisodeResult]], error: Exception) -> None:
        """End whatever is known of this agent without a result."""
        with self._lock:
            lost = [future for request, future in self._waiting if request.episode.agent == agent]
            self._waiting = [item for item in self._waiting if item[0].episode.agent != agent]
        for future in (*taken.values(), *lost):
            future.set_exception(error)
        taken.clear()


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
        from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent  # worker processes have their own
        from pytest_drive_robust.runner.episode.loop import Watch
        from pytest_drive_robust.runner.episode.threads import OneThread

        self._one_thread = one_thread = OneThread()

        def made(name: str) -> Agent:
            agent = make_agent(registry, name)
            one_thread.limit()  # also what it loaded
            return agent

        class _Ticks(Watch):
            """Hears of every tick."""

            def ticked(self, *_: object) -> None:
                ticked()

        driver = EpisodeDriver(lambda: registry.simulator(simulator, options), made, watch=_Ticks())
        super().__init__(
            lambda agent: [driver], width=width, shares=lambda agent: factory_offers_lockstep(agent, registry)
        )
        self._simulator = simulator

    def _work(self) -> None:
        with self._one_thread:
            super()._work()

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
    made = None
    with suppress(Exception):  # an annotation that names something imported for type checkers only, or no function
        made = typing.get_type_hints(factory).get("return")
    return offers_lockstep(factory) or offers_lockstep(made)
