"""The base class of executors, which turn requests into finished episodes, and the protocol of drivers."""

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
    """Drives in the caller's thread until an episode has ended or none is left; None when others drive.

    The scheduler calls `work` repeatedly while it waits for an episode.
    """

    @property
    @abstractmethod
    def slots(self) -> int:
        """Return how many episodes the executor can drive at this moment."""

    @abstractmethod
    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Begin an episode and return a future of its result. The caller never exceeds `slots`.

        An episode that breaks has a result, too (`agent_error`, `infra_error`). The future raises only `UsageError`,
        when the agent or the simulator cannot be made at all, and `Stopped`, when `close` cut the episode off.
        """

    def finished(self, request: EpisodeRequest) -> EpisodeResult | None:
        """Return the result that the executor itself keeps, so that `submit` would not drive the episode; else None.

        Raises `UsageError` when the kept result cannot be used.
        """
        return None

    @abstractmethod
    def close(self) -> None:
        """Free simulators, agents and processes; episodes under way have no result. A second call does nothing."""

    @property
    def compiling(self) -> tuple[int, int]:
        """Return (done, total) of the functions being compiled that episodes may wait for."""
        return 0, 0

    def drives(self, agent: str) -> bool:
        """Return whether an agent can be driven now, without waiting for a compiler."""
        return True

    def together(self, agent: str) -> int:
        """Return how many episodes of an agent share a driver and its time: more than one in lockstep."""
        return 1

    def last_words(self) -> tuple[tuple[str, str], ...]:
        """Return (episode, end of its output) of the first episodes that broke since the last call."""
        return ()


class Driver(Protocol):
    """Drives one episode or one batch at a time, here (`EpisodeDriver`) or in a process (`engine.supervisor`).

    `output` is the end of the output at the latest result. Methods raise `UsageError`, `Stopped`.
    """

    output: str

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        """Drive an episode by `act`, or with `width` in its own batch; drive again when the agent is not to blame."""

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None], width: int
    ) -> Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]:
        """Drive up to `width` episodes at once; yield (request, result) for each as soon as it ends.

        An episode whose result is None must be driven alone. `take` returns the next request, or None when there is
        none now; it is called repeatedly, and may return another request later.
        """

    def close(self) -> None:
        """Free worlds, agents and processes."""
