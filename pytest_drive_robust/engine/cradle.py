"""One process for all workers of a run that loads the world once: their fork_servers are forked from it.

It belongs to the process that starts the workers and ends with it. A worker that finds none, or one with another Python
or another environment, starts a fork_server of its own, so nothing but time depends on it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["Adopted", "Cradle", "Knock", "knock", "surroundings_of"]

_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from pytest_drive_robust.engine.worker.forking import cradle; cradle({}, {})"
)
_READ_WHEN_LOADED = (
    *("GOMP", "KMP", "LANG", "LC_", "LD_PRELOAD", "LLVM", "MALLOC", "MKL", "MPL", "NPY", "NUMBA", "NUMEXPR", "NUMPY"),
    *("OMP", "OPENBLAS", "OPENCV", "PYGAME", "PYTHON", "SDL", "TZ", "VECLIB"),
)
"""How the names of variables begin that decide once for all how Python and the libraries of a simulator work."""
_WAITING = 64


class Knock(NamedTuple):
    """What a worker asks the cradle for: a fork_server of this worker_setup, with this environment.

    `surroundings` must be those of the cradle.
    """

    surroundings: str
    environment: dict[str, str]
    worker_setup: WorkerSetup


def surroundings_of(worker_setup: WorkerSetup) -> str:
    """A digest of what a process cannot change any more when it has loaded its libraries."""
    fixed = sorted(item for item in worker_setup.environment().items() if item[0].startswith(_READ_WHEN_LOADED))
    known = (sys.executable, sys.version, __file__, worker_setup.simulator, worker_setup.threads, fixed)
    return hashlib.sha256(repr(known).encode("utf-8", "surrogateescape")).hexdigest()


def knock(worker_setup: WorkerSetup, output: int) -> socket.socket | None:
    """Ask for a fork_server whose output goes to that descriptor. Its channel, None when nobody is at home."""
    if not worker_setup.cradle or sys.platform != "linux":
        return None
    asked = Knock(surroundings_of(worker_setup), worker_setup.environment(), worker_setup)
    channel = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        channel.connect(worker_setup.cradle)
        socket.send_fds(channel, [pickle.dumps(asked)], [output])
    except OSError:
        channel.close()
        return None
    return channel


class Adopted:
    """A fork_server that is no child of ours: it lives as long as the other end of its channel is open."""

    def __init__(self, channel: socket.socket, pid: int) -> None:
        self.pid = pid
        self._channel = channel.dup()
        self._code: int | None = None

    def poll(self) -> int | None:
        """None while it lives."""
        if self._code is None and select.select([self._channel], [], [], 0)[0]:
            with contextlib.suppress(OSError):
                if self._channel.recv(1, socket.MSG_PEEK):
                    return None
            self._code = 0
            self._channel.close()
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """Until it has ended. Raises `subprocess.TimeoutExpired`."""
        if self._code is None:
            select.select([self._channel], [], [], timeout)
        code = self.poll()
        if code is None:
            raise subprocess.TimeoutExpired("fork_server", timeout or 0.0)
        return code

    def kill(self) -> None:
        """End it and its group."""
        if self.poll() is None:
            with contextlib.suppress(OSError):
                os.killpg(self.pid, signal.SIGKILL)


class Cradle:
    """The side of the process that starts the workers.

    `place` is where they find it. Nothing is started before `begin`, or the first worker that knocks after `wait`.
    """

    def __init__(self, worker_setup: WorkerSetup, place: Path) -> None:
        self._setup = replace(worker_setup, cradle="")
        self._place = place
        self._door: socket.socket | None = None
        self._lifeline: tuple[int, int] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None

    def open(self, *, at_once: bool) -> None:
        """Let workers knock. `at_once`: one of them surely will. Where it cannot be had, nothing happens."""
        if sys.platform != "linux":
            return
        door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            door.bind(os.fspath(self._place))
            door.listen(_WAITING)
        except OSError:  # a folder whose name is too long, or on a disk that knows no sockets
            door.close()
            return
        self._door, self._lifeline = door, os.pipe()
        if at_once:
            self._launch()
        else:
            self._thread = threading.Thread(target=self._attend, name="drive-robust cradle", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End it, and with it the fork_servers that are left. Calling it twice does no harm."""
        lifeline, self._lifeline = self._lifeline, None
        if lifeline is None:
            return
        os.close(lifeline[1])
        if self._thread is not None:
            self._thread.join()
        os.close(lifeline[0])
        if self._door is not None:
            self._door.close()
        with contextlib.suppress(OSError):
            self._place.unlink()
        if self._process is not None:
            try:
                self._process.wait(3.0)
            except subprocess.TimeoutExpired:  # still loading
                self._process.kill()
                self._process.wait()

    def _attend(self) -> None:
        assert self._door is not None
        assert self._lifeline is not None
        door = self._door.fileno()
        if door in select.select([door, self._lifeline[0]], [], [])[0]:
            self._launch()

    def _launch(self) -> None:
        door, lifeline = self._door, self._lifeline
        assert door is not None
        assert lifeline is not None
        code = _CODE.format(door.fileno(), lifeline[0])
        with contextlib.suppress(OSError, UsageError):
            self._process = subprocess.Popen(
                [sys.executable, "-c", code, json.dumps(self._setup.python_path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(door.fileno(), lifeline[0]),
                env=self._setup.environment(),
                cwd=self._setup.folder,
                start_new_session=True,
            )
            assert self._process.stdin is not None
            with self._process.stdin as request:
                request.write(pickle.dumps(self._setup))
        door.close()  # when the process dies, nobody waits at its door
        self._door = None
