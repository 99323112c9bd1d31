"""Where worker processes come from: forked by a process of our own that has loaded everything.

This is not the forkserver context of `multiprocessing`, because that one

- is one server per process, with one list of modules to preload and the environment, the current folder and (before
  Python 3.12) the `sys.path` of the moment when it was started; ours has those of one `WorkerSetup`;
- runs the main module of the program again in every worker: here that is pytest;
- stays in our process group, so that Ctrl-C at the terminal reaches every worker, and nobody adopts and ends the
  processes that a worker leaves when it is killed; our server is a subreaper with a session of its own;
- and the sentinel of a `fork` context is a pipe that an agent can close, and that its own sub-processes inherit: it
  then tells of the end of a worker too early, or never. Here only the server holds the other end of a sentinel.

The connections are those of `multiprocessing.connection`.
"""

from __future__ import annotations

import json
import os
import select
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import IO, TYPE_CHECKING

from pytest_drive_robust import errors
from pytest_drive_robust.engine.messages import refusal
from pytest_drive_robust.engine.worker_process import WorkerProcess

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["ForkServer", "NoWorkerError", "Stopped"]

_READY_S = 600.0
"""Kernels may have to be compiled first."""
_POLL_S = 0.1
_TRIES = 3


class Stopped(Exception):  # noqa: N818 - it is no error: somebody asked for it
    """Somebody asked to stop: what was under way has no result."""


class NoWorkerError(Exception):
    """No worker process can be had. The message says why."""


class ForkServer:
    """Starts the worker processes of one setup; from any thread. Nothing is started before the first one is asked for.

    On Linux workers are forked. Elsewhere, and where a plugin starts threads while it is imported, forking a process
    that has loaded numerical libraries is not safe, and each worker is a new Python. Raises `UsageError` on systems
    without either.
    """

    def __init__(self, worker_setup: WorkerSetup) -> None:
        if os.name != "posix":
            raise errors.UsageError(
                "guarded processes need Linux or macOS (on Windows: inside WSL). Give --drive-executor inline."
            )
        self._setup = worker_setup
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._log: IO[bytes] | None = None
        self._ready = False
        self.compiling = (0, 0)
        """How many functions are compiled, of how many that were not in the cache when the server was started."""

    @property
    def pid(self) -> int | None:
        """The server's process, while there is one."""
        return self._process.pid if self._process is not None else None

    def start_worker(self, limits: Limits, unwanted: Callable[[], bool] = lambda: False) -> WorkerProcess:
        """Start a worker process.

        Raises `UsageError` for a setup that does not work, `NoWorkerError`, and `Stopped` soon after `unwanted()` has
        become true: getting ready may take a minute where kernels have to be compiled.
        """
        problem = ""
        for _ in range(_TRIES):
            with self._lock:
                if unwanted():
                    raise Stopped
                try:
                    self._start(unwanted)
                    assert self._control is not None
                    return WorkerProcess(self._control, limits, tick_cap=self._setup.options.tick_cap)
                except (OSError, NoWorkerError) as error:
                    problem = f"{error} {self._last_line()}"
                    self._stop()
        raise NoWorkerError(f"no process for the episode can be started: {problem}")

    def close(self) -> None:
        """End the server, and with it every worker. Calling it twice does no harm."""
        with self._lock:
            self._stop()

    def _start(self, unwanted: Callable[[], bool]) -> None:
        """Start the server, unless it runs. An agent module that breaks it is left to the workers."""
        if self._process is not None and self._process.poll() is None:
            return
        self._stop()
        forks = self._launch(unwanted)
        if not forks and self._setup.preload_agents:
            self._setup = replace(self._setup, preload_agents=())
            self._stop()
            forks = self._launch(unwanted)
        if forks is None:
            raise NoWorkerError("the process that starts all others died while it was getting ready.")
        self._ready = True

    def _launch(self, unwanted: Callable[[], bool]) -> bool | None:
        """Start a new server and tell whether it forks; None when it died while it was getting ready.

        Raises `UsageError`, `Stopped`.
        """
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        self._control, theirs = socket.socketpair()
        with theirs:
            arguments = theirs.fileno(), os.getpid()
            self._process = self._setup.start_python(
                "serve_forks", arguments, self._setup, pass_fds=arguments[:1], output=self._log.fileno()
            )
        line = self._ready_line(unwanted)
        answer = json.loads(line or "{}")
        if "type" in answer:
            self._stop()
            raise refusal(line)
        forks: bool | None = answer.get("forks")
        return forks

    def _ready_line(self, unwanted: Callable[[], bool]) -> bytes:
        """Return what the server said when it was ready, nothing when it died before. Raises `Stopped`.

        Until then it says how far it has come with compiling: `compiling`.
        """
        assert self._control is not None
        deadline = time.monotonic() + _READY_S
        with suppress(OSError), self._control.makefile("rb", buffering=0) as file:
            while True:
                while not select.select([self._control], [], [], _POLL_S)[0]:
                    if unwanted():
                        self._stop()
                        raise Stopped
                    if time.monotonic() > deadline:
                        return b""
                line = file.readline()
                if not line.startswith(b'{"compiling"'):
                    return line
                self.compiling = tuple(json.loads(line)["compiling"])
        return b""

    def _last_line(self) -> str:
        """Return what the server printed last, as a sentence."""
        if self._log is None:
            return ""
        self._log.seek(0)
        lines = self._log.read()[-2000:].decode("utf-8", "replace").strip().splitlines()
        return f"It said: {lines[-1]}" if lines else "It said nothing."

    def _stop(self) -> None:
        if self._control is not None:
            with suppress(OSError):
                self._control.shutdown(socket.SHUT_WR)
            self._control.close()
        if self._process is not None:
            if not self._ready:
                self._process.kill()  # it hears nothing while it loads, and has no workers yet
            try:
                self._process.wait(3.0)  # it kills its workers first
            except subprocess.TimeoutExpired:
                with suppress(OSError):
                    os.killpg(self._process.pid, 9)
                self._process.wait()
        if self._log is not None:
            self._log.close()
        self._control = self._process = self._log = None
        self._ready = False
        self.compiling = (0, 0)
