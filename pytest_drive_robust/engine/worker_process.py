"""A worker process from our side: its connection, what it prints, how it ended."""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
import socket
import struct
import threading
import time
from contextlib import ExitStack
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.engine.shared_state import SharedState, shared_file, state_bytes

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits

__all__ = ["Descriptors", "WorkerProcess"]

_EXIT_S = 0.5
_FORK_S = 30.0
_STALLED_S = 10
"""The rest of a message comes within this time: a worker writes it in one go, and anybody else does not."""


class Descriptors(NamedTuple):
    """What a worker inherits: for messages, for what is printed, for faulthandler, of the shared state."""

    messages: int
    output: int
    faults: int
    state: int


class WorkerProcess:
    """One worker process, started by the fork server behind `control`. Raises `OSError` when that does not work.

    `connection` carries the messages, `output` is the descriptor with what is printed, `faults` that of what
    faulthandler wrote, `sentinel` becomes readable when the process ends.
    """

    def __init__(self, control: socket.socket, limits: Limits, *, tick_cap: int) -> None:
        self._lock = threading.Lock()
        self._status: int | None = None
        self._closed = False
        with ExitStack() as ours:
            with ExitStack() as theirs:  # our copies of what it inherits, until it has them
                our_socket, their_socket = socket.socketpair()
                theirs.callback(their_socket.close)
                our_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", _STALLED_S, 0))
                self.connection = ours.enter_context(Connection(our_socket.detach()))
                self.output, output = _pipe(ours, theirs)
                os.set_blocking(self.output, False)
                self.sentinel, exit_w = _pipe(ours, theirs)
                self.faults, state = shared_file("faults", 0), shared_file("state", state_bytes(tick_cap))
                ours.callback(os.close, self.faults)
                theirs.callback(os.close, state)
                self.state = SharedState(state)
                descriptors = Descriptors(their_socket.fileno(), output, self.faults, state)
                socket.send_fds(control, [pickle.dumps(limits)], [exit_w, *descriptors])
            self.pid = self._read_pid()
            self._ours = ours.pop_all()

    def _read_pid(self) -> int:
        if not select.select([self.sentinel], [], [], _FORK_S)[0]:
            raise TimeoutError(f"it did not fork within {_FORK_S:g} s")
        told = os.read(self.sentinel, 4)
        if len(told) < 4:
            raise ConnectionError("it died instead of forking")
        return int.from_bytes(told, "little", signed=True)

    def wait(self, timeout_s: float) -> int | None:
        """Return how it ended (as `os.waitpid` tells it), None when it still runs after so many seconds."""
        deadline = time.monotonic() + timeout_s
        while True:
            with self._lock:
                status = self._read_status()
            left_s = deadline - time.monotonic()
            if status is not None or left_s <= 0:
                return status
            select.select([self.sentinel], [], [], left_s)

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send a signal to it, SIGKILL to its whole group. From any thread, also when it is dead."""
        with self._lock, contextlib.suppress(OSError):
            if self._closed or self._read_status() is not None:
                return  # its number may belong to somebody else by now
            (os.killpg if number == signal.SIGKILL else os.kill)(self.pid, number)

    def end(self) -> None:
        """End it and everything in its group. One that waits for a message may close its simulator before."""
        self.connection.close()
        if self.wait(_EXIT_S) is None:
            self.kill()
        self.close()

    def close(self) -> None:
        """Free what belongs to it here. Calling it twice does no harm."""
        with self._lock:
            self._closed = True
            self._ours.close()

    def _read_status(self) -> int | None:
        if self._status is None and not self._closed and select.select([self.sentinel], [], [], 0)[0]:
            told = os.read(self.sentinel, 4)
            # Nothing was told: the fork server died, and its workers with it.
            self._status = int.from_bytes(told, "little", signed=True) if len(told) == 4 else int(signal.SIGKILL)
        return self._status


def _pipe(reading: ExitStack, writing: ExitStack) -> tuple[int, int]:
    """Make a pipe whose ends are closed with their stacks."""
    reader, writer = os.pipe()
    reading.callback(os.close, reader)
    writing.callback(os.close, writer)
    return reader, writer
