"""A worker process seen from our side: its connection, its output, its exit status."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pickle
import signal
import socket
import struct
import tempfile
import threading
from contextlib import ExitStack
from multiprocessing.connection import Connection, wait

from pytest_drive_robust.engine.shared_state import SharedState, shared_file
from pytest_drive_robust.engine.worker_setup import Limits

_EXIT_S = 0.5
_MOST_OUTPUT_BYTES = 1 << 24
_FORK_S = 30.0
_STALLED_S = 10
"""Seconds for the rest of a begun message: a worker writes a message at once, only other code does not."""


class WorkerProcess:
    """One worker process, started by the fork server behind `control`. Raises `OSError` when the start fails.

    `connection` carries the messages; `sentinel` becomes readable when the process ends. The worker inherits the
    descriptors of the messages, the output and the shared state. `drives` names the agents whose compiled kernels the
    worker has loaded, None for all agents.
    """

    def __init__(self, control: socket.socket, limits: Limits, *, tick_cap: int, drives: frozenset[str] | None) -> None:
        self.drives = drives
        self._lock = threading.Lock()
        self._status: int | None = None
        self._closed = False
        with ExitStack() as ours:
            with ExitStack() as theirs:  # our copies of the worker's descriptors, closed once sent
                our_socket, their_socket = socket.socketpair()
                theirs.callback(their_socket.close)
                our_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", _STALLED_S, 0))
                self.connection = ours.enter_context(Connection(our_socket.detach()))
                self.sentinel, exit_w = os.pipe()
                ours.callback(os.close, self.sentinel)
                theirs.callback(os.close, exit_w)
                self._output = ours.enter_context(tempfile.TemporaryFile()).fileno()
                fcntl.fcntl(self._output, fcntl.F_SETFL, os.O_APPEND)
                state = shared_file(tick_cap)
                theirs.callback(os.close, state)
                self.state = SharedState(state)
                self.state.clear()  # zeros mean `MAKE`, which would blame the agent for our failure
                inherited = their_socket.fileno(), self._output, state
                socket.send_fds(control, [pickle.dumps(limits)], [exit_w, *inherited])
            self.pid = self._read_pid()
            self._ours = ours.pop_all()

    def _read_pid(self) -> int:
        if not wait([self.sentinel], _FORK_S):
            raise TimeoutError(f"it did not fork within {_FORK_S:g} s")
        told = os.read(self.sentinel, 4)
        if len(told) < 4:
            raise ConnectionError("it died instead of forking")
        return int.from_bytes(told, "little", signed=True)

    def printed(self, most_bytes: int) -> str:
        """Return the last `most_bytes` bytes of output since `forget_output`, as text."""
        size = os.fstat(self._output).st_size
        text = os.pread(self._output, most_bytes, max(0, size - most_bytes)).decode("utf-8", "replace")
        if size > _MOST_OUTPUT_BYTES:
            self.forget_output()
        return text

    def forget_output(self) -> None:
        """Forget the output so far."""
        os.ftruncate(self._output, 0)

    def wait(self, timeout_s: float) -> int | None:
        """Return the status of `os.waitpid` when the process has ended, None if it still runs after `timeout_s`."""
        wait([self.sentinel], timeout_s)
        with self._lock:
            return self._read_status()

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send a signal to the process, SIGKILL to its whole group. Safe from any thread, and after its end."""
        with self._lock, contextlib.suppress(OSError):
            if self._closed or self._read_status() is not None:
                return  # the process id may belong to another process by now
            (os.killpg if number == signal.SIGKILL else os.kill)(self.pid, number)

    def end(self) -> None:
        """End the process and its group. A worker that waits for a message has 0.5 s to close its simulator first."""
        self.connection.close()
        if self.wait(_EXIT_S) is None:
            self.kill()
        with self._lock:
            self._closed = True
            self._ours.close()

    def _read_status(self) -> int | None:
        if self._status is None and not self._closed and wait([self.sentinel], 0.0):
            told = os.read(self.sentinel, 4)
            # Without a status: the fork server died, and its workers with it.
            self._status = int.from_bytes(told, "little", signed=True) if len(told) == 4 else int(signal.SIGKILL)
        return self._status
