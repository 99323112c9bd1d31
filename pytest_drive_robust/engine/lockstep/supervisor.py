"""Drives batches in a worker process that may break: whatever happens to it, each of their episodes has a result."""

from __future__ import annotations

import contextlib
import os
import pickle
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.exchange import Exchange
from pytest_drive_robust.engine.fork_server import NoWorkerError
from pytest_drive_robust.engine.messages import ALONE, CHECK, TOGETHER, TOKEN_BYTES, Message, PickledRequest
from pytest_drive_robust.engine.supervisor import FailedAttempt, Supervisor
from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.fork_server import ForkServer
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.runner.plan import EpisodeRequest

    Ended = Generator[tuple[EpisodeRequest, EpisodeResult | UsageError | None], None, None]

__all__ = ["LockstepSupervisor"]


class LockstepSupervisor(Supervisor):
    """One worker process at a time (see `runner.lockstep.executor.BatchDriver`).

    `drive` gives an episode a batch of its own. An episode of a batch takes as long as all of them: each may take
    `width` times the limit of an episode. A call of `act_batch` has the time of any other call.
    """

    _kind = ALONE

    def __init__(self, fork_server: ForkServer, limits: Limits, *, width: int) -> None:
        episode_s = None if limits.episode_s is None else limits.episode_s * width
        super().__init__(fork_server, replace(limits, episode_s=episode_s))
        self._width = width
        self._news_r, self._news_w = os.pipe()
        os.set_blocking(self._news_w, False)

    def check(self, request: EpisodeRequest) -> bool:
        """See `BatchDriver.check`. False also when the process broke. Raises `UsageError`, `Stopped`."""
        ended = self._attempt(CHECK, self._payload(PickledRequest.of(request)), self._limits)
        return not isinstance(ended, FailedAttempt) and ended.outcome is Outcome.COMPLETED

    def wake(self) -> None:
        """Have `drive_batch` take again. From any thread."""
        with contextlib.suppress(BlockingIOError):  # it is full of news
            os.write(self._news_w, b"n")

    def drive_batch(self, agent: str, take: Callable[[], EpisodeRequest | None]) -> Ended:
        """Drive what `take` gives, up to `width` at a time, until none is under way.

        Those without a result, whose process broke, come last. Raises `Stopped`.
        """
        under_way: dict[bytes, EpisodeRequest] = {}
        leaving = False

        def next_message() -> Message | None:
            request = None if leaving or len(under_way) >= self._width else take()
            if request is None:
                return None
            token = os.urandom(TOKEN_BYTES)
            under_way[token] = request
            return Message(TOGETHER, token, self._payload(PickledRequest.of(request)))

        try:
            worker = self._ready_worker()
        except NoWorkerError:
            yield from ((request, None) for request in iter(take, None))
            return
        exchange = Exchange(worker, self._limits, self._news_r)
        for token, answer in exchange.run(next_message):
            self._check_stopped()
            self.output = exchange.printed
            leaving = leaving or self._is_spent(answer)
            result = answer.result
            yield under_way.pop(token), result if isinstance(result, UsageError) else self._judged(result)
        self.output = exchange.printed
        self._check_stopped()
        if exchange.death is not None or leaving:
            self._end_worker()
        yield from ((request, None) for request in under_way.values())

    def close(self) -> None:
        """End the process. Called once nothing is driven any more."""
        super().close()
        os.close(self._news_r)
        os.close(self._news_w)

    def _payload(self, order: PickledRequest) -> bytes:
        return pickle.dumps((order, self._width))

    def _salvaged(self, failure: FailedAttempt, order: PickledRequest) -> EpisodeResult | None:
        result = super()._salvaged(failure, order)
        if result is None:
            return None
        return replace(result, versions={**result.versions, "lockstep": str(self._width)})
