"""Where worker processes come from: forked by a process of our own that has loaded everything.

This is not the forkserver context of `multiprocessing` (the connections are its own), because that one

- has one list of modules to preload, and the environment, the current folder and (before Python 3.12) the `sys.path` of
  the moment when it was started; ours has those of one `WorkerSetup`;
- runs the main module of the program again in every worker: here that is pytest;
- stays in our process group, where Ctrl-C reaches every worker, and leaves the processes that a killed worker leaves;
  our server is a subreaper with a session of its own;
- and the sentinel of a `fork` context is a pipe that an agent can close, and that its own sub-processes inherit: it
  tells of the end of a worker too early, or never. Here only the server holds the other end of a sentinel.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import IO, Any

from pytest_drive_robust.engine.messages import refusal
from pytest_drive_robust.engine.worker_process import WorkerProcess
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError

_READY_S = 600.0
"""Kernels may have to be compiled first."""
_POLL_S = 0.1
_EXIT_S = 3.0
_TRIES = 3


class Stopped(Exception):  # noqa: N818 - it is no error: somebody asked for it
    """Somebody asked to stop: what was under way has no result."""


class NoWorkerError(Exception):
    """No worker process can be had. The message says why."""


class ForkServer:
    """Starts the worker processes of one setup; from any thread. Nothing is started before the first one is asked for.

    It `is_ready` when workers can be started for some agents or all. On Linux workers are forked. Elsewhere, and where
    a plugin starts threads while it is imported, forking a process that has loaded numerical libraries is not safe, and
    each worker is a new Python. `platform_check` is for systems without either.

    `check_loaded` is called when the server has loaded everything, and raises `UsageError` where that is not what was
    asked for.
    """

    def __init__(self, worker_setup: WorkerSetup, check_loaded: Callable[[], None] = lambda: None) -> None:
        self._setup = worker_setup
        self._check_loaded = check_loaded
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._log: IO[bytes] | None = None
        self.is_ready = False
        self._drives: frozenset[str] | None = None
        self._compiling = (0, 0)

    @property
    def pid(self) -> int | None:
        """The server's process, while there is one."""
        return self._process.pid if self._process is not None else None

    @property
    def compiling(self) -> tuple[int, int]:
        """How many functions are compiled, of how many that some agent waits for and that were not in the cache."""
        self._hear()
        return self._compiling

    def drives(self, agent: str) -> bool:
        """Return False while kernels that this agent may need are compiled, and others can be driven already."""
        if self._drives is not None:
            self._hear()
        drives = self._drives
        return drives is None or agent in drives

    def start_worker(self, limits: Limits, agent: str, unwanted: Callable[[], bool]) -> WorkerProcess:
        """Start a worker process that can drive the agent.

        Raises `UsageError` for a setup that does not work, `NoWorkerError`, `Stopped` soon after `unwanted()` is true.
        """
        problems: list[str] = []
        while len(problems) < _TRIES:
            with self._lock:
                if unwanted():
                    raise Stopped
                try:
                    self._start(unwanted)
                    if self._drives is None or agent in self._drives:
                        assert self._control is not None
                        tick_cap = self._setup.options.tick_cap
                        return WorkerProcess(self._control, limits, tick_cap=tick_cap, drives=self._drives)
                except (OSError, NoWorkerError) as error:
                    problems.append(f"{error} {self._last_line()}")
                    self._stop()
            self._hear()
            time.sleep(_POLL_S)
        raise NoWorkerError(f"no process for the episode can be started: {problems[-1]}")

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
            raise NoWorkerError(f"the process that starts all others {self._why_not_ready()}.")
        try:
            self._check_loaded()
        except UsageError:
            self._stop()
            raise
        self.is_ready = True

    def _launch(self, unwanted: Callable[[], bool]) -> bool | None:
        """Start a new server and tell whether it forks, None when it died before. Raises `UsageError`, `Stopped`.

        Until it is ready it says how far it has come with compiling.
        """
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        self._control, theirs = socket.socketpair()
        with theirs:
            arguments = theirs.fileno(), os.getpid()
            self._process = self._setup.start_python(
                "serve_forks", arguments, self._setup, pass_fds=arguments[:1], output=self._log.fileno()
            )
        deadline = time.monotonic() + _READY_S
        with suppress(OSError, EOFError), Connection(os.dup(self._control.fileno())) as connection:
            while time.monotonic() < deadline:
                if unwanted():
                    self._stop()
                    raise Stopped
                if connection.poll(_POLL_S):
                    said = connection.recv_bytes()
                    words = json.loads(said)
                    if isinstance(words, list):
                        self._stop()
                        raise refusal(said)
                    self._note(words)
                    if "forks" in words:
                        return bool(words["forks"])
        return None

    def _why_not_ready(self) -> str:
        """Say what became of a server that was not ready, when it has printed why."""
        assert self._process is not None
        try:
            self._process.wait(_EXIT_S)
        except subprocess.TimeoutExpired:
            return f"was not ready within {_READY_S:g} s"
        return "died while it was getting ready"

    def _hear(self) -> None:
        """Take in what the server has said since it was ready; return at once."""
        if not self._lock.acquire(blocking=False):  # somebody starts a worker, or the server itself
            return
        try:
            if self.is_ready and self._control is not None:
                with Connection(os.dup(self._control.fileno())) as connection:
                    while connection.poll():
                        self._note(json.loads(connection.recv_bytes()))
        except (OSError, EOFError):  # it has died
            self._drives = None
        finally:
            self._lock.release()

    def _note(self, words: dict[str, Any]) -> None:
        self._compiling = tuple(words.get("compiling", self._compiling))
        if "forks" in words:
            self._drives = None if words["drives"] is None else frozenset(words["drives"])

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
            try:  # it kills its workers first; while it loads it has none, and hears nothing
                self._process.wait(_EXIT_S if self.is_ready else 0.0)
            except subprocess.TimeoutExpired:
                with suppress(OSError):
                    os.killpg(self._process.pid, 9)
                self._process.wait()
        if self._log is not None:
            self._log.close()
        self._control = self._process = self._log = None
        self.is_ready = False
        self._drives, self._compiling = None, (0, 0)
