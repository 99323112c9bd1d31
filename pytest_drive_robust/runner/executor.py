"""Who turns requests into finished episodes: the base class of executors, and what drives for one on this machine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from concurrent.futures import Future
from typing import Protocol

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.plan import EpisodeRequest


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
