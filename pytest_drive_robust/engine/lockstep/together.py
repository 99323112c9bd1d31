"""In a child process: episodes that arrive one after the other are driven in lockstep, each answered when it ends."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.engine.messages import REFUSED, RESULT, Message, receive, refusal_bytes
from pytest_drive_robust.engine.shared_state import Phase
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.engine.lockstep.crew import Crew
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["drive_together"]


class _Reply(Protocol):
    def __call__(self, token: bytes, kind: bytes, body: bytes, *, over: bool = True) -> None: ...


def drive_together(crew: Crew, first: Message, connection: Connection, reply: _Reply) -> None:
    """Drive the first order and all that arrive on `connection` before none is under way any more.

    They are all of one agent. `reply` gets the token of the order; the last one is `over`. What an episode raises that
    is no fault of its agent (`SystemExit` of a simulator) ends the process: each is then tried in one of its own.
    """
    crew.board.clear()
    inbox = _Inbox(crew, first, connection, reply)
    driving = crew.drive(inbox, agent=inbox.agent, width=inbox.width)
    for task, result in driving:
        token = inbox.tokens.pop(id(task))[0]
        over = not inbox.tokens
        if over:
            driving.close()  # before the surroundings are put back
            crew.board.enter(Phase.IDLE, result.ticks)
        reply(token, RESULT, encode_episode(result), over=over)
        if over:
            return


class _Inbox:
    """The tasks that have arrived. There may be none now and another one later."""

    def __init__(self, crew: Crew, first: Message, connection: Connection, reply: _Reply) -> None:
        self._crew = crew
        self._reply = reply
        self._connection = connection
        self._first: Message | None = first
        order, self.width = pickle.loads(first.payload)
        self.agent: str = order.episode.agent
        self.tokens: dict[int, tuple[bytes, EpisodeRequest]] = {}

    def __iter__(self) -> Iterator[EpisodeRequest]:
        return self

    def __next__(self) -> EpisodeRequest:
        while (frame := self._next_frame()) is not None:
            order, _ = pickle.loads(frame.payload)
            try:
                task = self._crew.task_of(order)
            except UsageError as error:
                self._reply(frame.token, REFUSED, refusal_bytes(error), over=not self.tokens)
                continue
            self.tokens[id(task)] = frame.token, task
            return task
        raise StopIteration

    def _next_frame(self) -> Message | None:
        if self._first is not None:
            frame, self._first = self._first, None
            return frame
        return receive(self._connection) if self._connection.poll() else None
