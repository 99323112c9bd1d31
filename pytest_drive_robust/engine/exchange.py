"""One request to a child and what comes back: an answer, or the news of its death."""

from __future__ import annotations

import json
import os
import select
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.engine.death import Cause, Death
from pytest_drive_robust.engine.frames import BrokenStreamError, Frame, FrameReader
from pytest_drive_robust.engine.wire import REFUSED, RESULT
from pytest_drive_robust.engine.worker.serve import split_answer
from pytest_drive_robust.store.record import decode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.shared_state import StateReading
    from pytest_drive_robust.engine.worker_process import WorkerProcess

__all__ = ["CHUNK_BYTES", "Answer", "Exchange", "Interrupted", "answer_in"]

CHUNK_BYTES = 1 << 16
_LAST_WORDS_S = 0.1
_BURIAL_S = 0.25
_LOOK_S = 0.2


@dataclass(frozen=True, slots=True)
class Answer:
    """What the child replied: a result, or why it cannot drive that at all. `rss` in bytes."""

    result: EpisodeResult | None
    refused: Mapping[str, str]
    rss: int
    leftovers: tuple[str, ...]


class Interrupted(Exception):  # noqa: N818 - it is no error: somebody asked for it
    """The descriptor that wakes us became readable."""


class Exchange:
    """Waits for one child, within the limits, by a clock and descriptors that are out of the child's reach."""

    def __init__(self, child: WorkerProcess, limits: Limits, wake_fd: int) -> None:
        self._child = child
        self._limits = limits
        self._wake_fd = wake_fd
        self._said = bytearray()
        self._reader = FrameReader()
        self._started_s = 0.0

    @property
    def said(self) -> str:
        """The end of what was printed since the request."""
        return bytes(self._said[-self._limits.output_bytes :]).decode("utf-8", "replace")

    def run(self, request: Frame) -> Answer | Death:
        """Send the request and wait. After a `Death` the child is dead, too. Raises `Interrupted`."""
        self._started_s = time.monotonic()
        try:
            self._child.send(request)
        except OSError:
            return self._lost()
        poller = select.poll()
        for number in (self._wake_fd, *self._child.channels[:2]):
            poller.register(number, select.POLLIN)
        if self._child.exit_fd is not None:
            poller.register(self._child.exit_fd, select.POLLIN)
        while True:
            ready = dict(poller.poll(1000.0 * self._patience_s()))
            if self._wake_fd in ready:
                raise Interrupted
            if self._child.channels.output in ready and not self._listen():
                poller.unregister(self._child.channels.output)
            if self._child.channels.messages in ready:
                ended = self._hear(request)
                if ended is not None:
                    return ended
            elif self._has_ended(ready) and not select.select([self._child.channels.messages], [], [], 0)[0]:
                return self._lost()  # without an answer that came in the last moment
            late = self._late()
            if late is not None:
                return late

    def _has_ended(self, ready: Mapping[int, int]) -> bool:
        fd = self._child.exit_fd
        return fd in ready if fd is not None else self._child.wait(0.0) is not None

    def _hear(self, request: Frame) -> Answer | Death | None:
        """What has arrived on the channel, None when it is not all."""
        try:
            piece = os.read(self._child.channels.messages, CHUNK_BYTES)
        except OSError:
            piece = b""
        if not piece:
            return self._lost()
        try:
            for frame in self._reader.feed(piece):
                if frame.token != request.token:
                    raise BrokenStreamError("the answer is to another request")
                self._listen()
                return answer_in(frame)
        except (BrokenStreamError, ValueError):
            return self._kill(Cause.GARBAGE)
        return None

    def _listen(self) -> bool:
        """Keep what was printed. False when nothing more can come."""
        try:
            while piece := os.read(self._child.channels.output, CHUNK_BYTES):
                self._said += piece
                if len(self._said) > 4 * self._limits.output_bytes + CHUNK_BYTES:
                    del self._said[: -self._limits.output_bytes]
                if len(piece) < CHUNK_BYTES:
                    return True
        except BlockingIOError:
            return True
        return False

    def _patience_s(self) -> float:
        """Until when nothing can become late. A call that begins after this moment is late after the next one."""
        now = time.monotonic()
        waits = [_LOOK_S] if self._child.exit_fd is None else []
        if self._limits.episode_s is not None:
            waits.append(self._started_s + self._limits.episode_s - now)
        if self._limits.act_s is not None:
            moment = self._child.board.look()
            begun_s = moment.since_s if moment.phase.is_call else now
            waits.append(begun_s + self._limits.act_s - now)
        return max(0.0, min(waits)) + 0.001 if waits else 3600.0

    def _late(self) -> Death | None:
        now = time.monotonic()
        moment = self._child.board.look()
        act_s, episode_s = self._limits.act_s, self._limits.episode_s
        if act_s is not None and moment.phase.is_call and now - moment.since_s > act_s:
            return self._kill(Cause.ACT_DEADLINE, moment, act_s)
        if episode_s is not None and now - self._started_s > episode_s:
            return self._kill(Cause.EPISODE_DEADLINE, moment, episode_s)
        return None

    def _lost(self) -> Death:
        """The channel was closed or the process ended: which one?"""
        status = self._child.wait(_BURIAL_S)
        if status is None:
            return self._kill(Cause.SILENT)
        return self._death(Cause.DIED, status=status)

    def _kill(self, cause: Cause, moment: StateReading | None = None, limit_s: float = 0.0) -> Death:
        """End the child, with a chance for faulthandler to say where it is."""
        moment = moment or self._child.board.look()
        if limit_s:
            self._child.kill(signal.SIGABRT)
            self._child.wait(_LAST_WORDS_S)
        self._child.kill()
        self._child.wait(_BURIAL_S)
        return self._death(cause, moment, limit_s=limit_s)

    def _death(
        self, cause: Cause, moment: StateReading | None = None, *, status: int | None = None, limit_s: float = 0.0
    ) -> Death:
        self._listen()
        now = time.monotonic()
        moment = moment or self._child.board.look()
        return Death(
            cause=cause,
            moment=moment,
            status=status,
            limit_s=limit_s,
            lasted_s=now - moment.since_s,
            elapsed_s=now - self._started_s,
            faults=_text(self._child.channels.faults),
            said=self.said,
        )


def answer_in(frame: Frame) -> Answer:
    """The meaning of a message. Raises `ValueError` when it has none."""
    notes, body = split_answer(frame.payload)
    rss, leftovers = int(notes["rss"]), tuple(map(str, notes["leftovers"]))
    if frame.kind == RESULT:
        return Answer(decode_episode(body), {}, rss, leftovers)
    if frame.kind == REFUSED:
        refused: dict[str, Any] = json.loads(body)
        return Answer(None, {"type": str(refused["type"]), "text": str(refused["text"])}, rss, leftovers)
    raise ValueError(f"an answer of kind {frame.kind!r}")


def _text(fd: int) -> str:
    """All of a small file, whatever has been read of it already."""
    return os.pread(fd, CHUNK_BYTES, 0).decode("utf-8", "replace")
