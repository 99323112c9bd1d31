"""Many requests to one worker process, under way at the same time and answered in any order."""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Callable, Generator, Mapping
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.death import Cause
from pytest_drive_robust.engine.exchange import CHUNK_BYTES, Answer, Exchange, Interrupted, answer_in
from pytest_drive_robust.engine.frames import BrokenStreamError, Frame, packed

if TYPE_CHECKING:
    from pytest_drive_robust.engine.death import Death
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_process import WorkerProcess

    Answers = Generator[tuple[bytes, Answer], None, None]

__all__ = ["BatchExchange"]


class BatchExchange(Exchange):
    """As `Exchange`, for requests that join while others are under way.

    `news_fd` becomes readable when there may be another request. The limit of an episode counts from its own request.
    `death` is how the process ended, where it did.
    """

    def __init__(self, child: WorkerProcess, limits: Limits, wake_fd: int, news_fd: int) -> None:
        super().__init__(child, limits, wake_fd)
        self._news_fd = news_fd
        self._begun_s: dict[bytes, float] = {}
        self._out = bytearray()
        self.death: Death | None = None

    def run_batch(self, take: Callable[[], Frame | None]) -> Answers:
        """Send what `take` gives and yield each answer with its token, until nothing is under way and none to be sent.

        After a `death` the process is gone. Raises `Interrupted`.
        """
        poller = select.poll()
        for number in (self._wake_fd, self._news_fd, self._child.channels.output):
            poller.register(number, select.POLLIN)
        if self._child.exit_fd is not None:
            poller.register(self._child.exit_fd, select.POLLIN)
        with socket.socket(fileno=os.dup(self._child.channels.messages)) as line:
            while self.death is None:
                self._send(take, line)
                if not self._begun_s:
                    return
                self._started_s = min(self._begun_s.values())
                poller.register(self._child.channels.messages, select.POLLIN | (select.POLLOUT if self._out else 0))
                ready = dict(poller.poll(1000.0 * self._patience_s()))
                if self._wake_fd in ready:
                    raise Interrupted
                if self._news_fd in ready:
                    os.read(self._news_fd, CHUNK_BYTES)
                if self._child.channels.output in ready and not self._listen():
                    poller.unregister(self._child.channels.output)
                yield from self._receive(ready)
                if self.death is None and self._begun_s:
                    self.death = self._late()

    def _send(self, take: Callable[[], Frame | None], line: socket.socket) -> None:
        """Send as much as there is room for: a process that answers must never wait for one that asks."""
        while (frame := take()) is not None:
            self._begun_s[frame.token] = time.monotonic()
            self._out += packed(frame)
        try:
            while self._out:
                del self._out[: line.send(self._out, socket.MSG_DONTWAIT)]
        except BlockingIOError:
            return
        except OSError:  # it is dead, which is noticed soon
            self._out.clear()

    def _receive(self, ready: Mapping[int, int]) -> Answers:
        messages = self._child.channels.messages
        if not ready.get(messages, 0) & ~select.POLLOUT:
            if self._has_ended(ready) and not select.select([messages], [], [], 0)[0]:
                self.death = self._lost()
            return
        try:
            piece = os.read(messages, CHUNK_BYTES)
        except OSError:
            piece = b""
        if not piece:
            self.death = self._lost()
            return
        try:
            for frame in self._reader.feed(piece):
                if self._begun_s.pop(frame.token, None) is None:
                    raise BrokenStreamError("the answer is to another request")
                answer = answer_in(frame)
                self._listen()
                yield frame.token, answer
        except (BrokenStreamError, ValueError):
            self.death = self._kill(Cause.GARBAGE)
