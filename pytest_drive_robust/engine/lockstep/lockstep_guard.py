"""Drives episodes in lockstep in a child process that may break: whatever happens to it, each of them has a result."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.exchange import Exchange, Interrupted
from pytest_drive_robust.engine.fork_server import NoWorkerError
from pytest_drive_robust.engine.messages import ALONE, TOGETHER, TOKEN_BYTES, VET, Answer, Message, refusal
from pytest_drive_robust.engine.pickled_request import PickledRequest
from pytest_drive_robust.engine.supervisor import FailedAttempt, Stopped, Supervisor
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.lockstep.vetting import Vetting

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.fork_server import ForkServer
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.runner.plan import EpisodeRequest

    Ended = Callable[[EpisodeRequest, EpisodeResult | UsageError], object]

__all__ = ["LockstepGuard"]


class LockstepGuard(Supervisor):
    """One child at a time. `drive` gives an episode a batch of its own, `drive_together` fills one with several.

    An episode of a batch takes as long as all of them: each may take `width` times the limit of an episode. A call of
    `act_batch` has the time of any other call.
    """

    _kind = ALONE

    def __init__(self, nursery: ForkServer, limits: Limits, *, width: int) -> None:
        episode_s = None if limits.episode_s is None else limits.episode_s * width
        super().__init__(nursery, replace(limits, episode_s=episode_s))
        self._width = width

    def vet(self, task: EpisodeRequest) -> Vetting:
        """May the agent of `task` be driven in lockstep? Raises `UsageError` and `Stopped` as `drive` does."""
        ended = self._attempt(VET, self._payload(PickledRequest.of(task)), self._limits)
        if isinstance(ended, FailedAttempt) or ended.outcome is Outcome.INFRA_ERROR:
            return Vetting(recorded=False)
        return Vetting(recorded=True, problem=ended.end_detail or None)

    def drive_together(
        self, first: EpisodeRequest, take: Callable[[], EpisodeRequest | None], ended: Ended, *, news_fd: int
    ) -> tuple[EpisodeRequest, ...]:
        """Drive `first` and what `take` gives, up to `width` at a time, until none is left; tell `ended` of each.

        All are of one agent. Returns those without a result, whose child broke or whose world did: they want to be
        driven alone. `news_fd` becomes readable when `take` may have something again. Raises `Stopped`, `UsageError`.
        """
        under_way: dict[bytes, EpisodeRequest] = {}
        again: list[EpisodeRequest] = []
        waiting = [first]
        leaving = False

        def next_frame() -> Message | None:
            if len(under_way) >= self._width or leaving:
                return None
            task = waiting.pop() if waiting else take()
            if task is None:
                return None
            token = os.urandom(TOKEN_BYTES)
            under_way[token] = task
            return Message(TOGETHER, token, self._payload(PickledRequest.of(task)))

        def hear(token: bytes, answer: Answer) -> None:
            nonlocal leaving
            task = under_way.pop(token)
            self.output = stream.printed
            leaving = leaving or bool(answer.leftovers) or self._grew(answer)
            if answer.result is None:
                ended(task, refusal(answer.refused))
            elif answer.result.outcome is Outcome.INFRA_ERROR:
                again.append(task)
                leaving = True
            else:
                ended(task, self._judged(answer.result))

        try:
            child = self._ready_worker()
        except NoWorkerError:
            return (first,)
        stream = Exchange(child, self._limits, self._wake_r, news_fd)
        try:
            death = stream.run(next_frame, hear)
        except Interrupted:
            self._discard()
            raise Stopped from None
        self.output = stream.printed
        if self._stopped.is_set():  # what ended while we were stopping is no result
            self._discard()
            raise Stopped
        if death is not None:
            self._discard()
        elif leaving:
            self._retire()
        return (*under_way.values(), *again)

    def _payload(self, order: PickledRequest) -> bytes:
        return pickle.dumps((order, self._width))

    def _grew(self, answer: Answer) -> bool:
        self._first_rss = self._first_rss or answer.rss
        return answer.rss - self._first_rss > self._limits.growth_bytes

    def _salvaged(self, failure: FailedAttempt, order: PickledRequest) -> EpisodeResult | None:
        result = super()._salvaged(failure, order)
        if result is None:
            return None
        return replace(result, versions={**result.versions, "lockstep": str(self._width)})
