"""A child process from its parent's side."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import threading
import time
from typing import Protocol

from pytest_drive_robust.engine.frames import Frame, write_frame
from pytest_drive_robust.engine.shared_state import SharedState
from pytest_drive_robust.engine.worker.serve import Descriptors

__all__ = ["ForkedChild", "SpawnedChild", "WorkerProcess"]

_POLL_S = 0.05


class WorkerProcess(Protocol):
    """One child process. `exit_fd` becomes readable when it ends; None where one has to ask now and then."""

    pid: int
    channels: Descriptors
    board: SharedState
    exit_fd: int | None

    def send(self, frame: Frame) -> None:
        """Give it a message. Raises `OSError` when it is dead."""
        ...

    def wait(self, timeout_s: float) -> int | None:
        """How it ended (as `os.waitpid` tells it), None when it still runs after so many seconds."""
        ...

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send a signal to it, SIGKILL to its whole group. From any thread, also when it is dead."""
        ...

    def hang_up(self) -> None:
        """Nothing more will be asked: a child that waits frees its simulator and ends."""
        ...

    def close(self) -> None:
        """Forget it."""
        ...


class _Child:
    """What both kinds share."""

    exit_fd: int | None = None

    def __init__(self, pid: int, ends: tuple[Descriptors, SharedState]) -> None:
        self.pid = pid
        self.channels, self.board = ends
        self._lock = threading.Lock()
        self._status: int | None = None
        self._closed = False
        os.set_blocking(self.channels.output, False)

    def send(self, frame: Frame) -> None:
        write_frame(self.channels.messages, frame)

    def wait(self, timeout_s: float) -> int | None:
        deadline = time.monotonic() + timeout_s
        while True:
            with self._lock:
                status = self._look()
            left_s = deadline - time.monotonic()
            if status is not None or left_s <= 0:
                return status
            self._sleep(left_s)

    def kill(self, number: int = signal.SIGKILL) -> None:
        with self._lock, contextlib.suppress(OSError):
            if self._closed or self._look() is not None:
                return  # its number may belong to somebody else by now
            (os.killpg if number == signal.SIGKILL else os.kill)(self.pid, number)

    def hang_up(self) -> None:
        with self._lock, contextlib.suppress(OSError):
            if not self._closed:
                with socket.socket(fileno=os.dup(self.channels.messages)) as other:
                    other.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self._closed = True
            for number in (*self.channels[:3], *(() if self.exit_fd is None else (self.exit_fd,))):
                os.close(number)
            self.board.close()

    def _look(self) -> int | None:
        raise NotImplementedError

    def _sleep(self, most_s: float) -> None:
        time.sleep(min(most_s, _POLL_S))


class ForkedChild(_Child):
    """A child of the fork_server, which tells of its end."""

    def __init__(self, pid: int, ends: tuple[Descriptors, SharedState], exit_fd: int) -> None:
        super().__init__(pid, ends)
        self.exit_fd: int | None = exit_fd
        self._exit = exit_fd

    def _look(self) -> int | None:
        if self._status is None and not self._closed and select.select([self._exit], [], [], 0)[0]:
            told = os.read(self._exit, 4)
            # Without a word: the fork_server died, and its children with it.
            self._status = int.from_bytes(told, "little", signed=True) if len(told) == 4 else int(signal.SIGKILL)
        return self._status

    def _sleep(self, most_s: float) -> None:
        select.select([self._exit], [], [], most_s)


class SpawnedChild(_Child):
    """A Python of its own."""

    def __init__(self, process: subprocess.Popen[bytes], ends: tuple[Descriptors, SharedState]) -> None:
        super().__init__(process.pid, ends)
        self._process = process

    def _look(self) -> int | None:
        code = self._process.poll()
        if code is not None and self._status is None:
            self._status = -code if code < 0 else code << 8
            with contextlib.suppress(OSError):
                os.killpg(self.pid, signal.SIGKILL)  # what it left
        return self._status
