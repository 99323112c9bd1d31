"""Starts worker processes: the fork server, a process of our own that has loaded everything, forks them.

The connections are those of `multiprocessing`, but not its forkserver context, because that context

- has one list of modules to preload, and the environment, the current folder and (before Python 3.12) the `sys.path` of
  the moment when it started; our fork server has those of one `WorkerSetup`;
- runs the main module of the program, here pytest, again in every worker;
- stays in our process group, where Ctrl-C reaches every worker, and does not kill the sub-processes of a killed worker;
  our fork server has its own session and is a subreaper.

The sentinel of a `fork` context is no better: an agent can close that pipe, and its sub-processes inherit the pipe, so
that the end of a worker shows too early or never. Here only the fork server holds the other end of a sentinel.
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
"""Seconds for the fork server to get ready: kernels may have to be compiled first."""
_POLL_S = 0.1
_EXIT_S = 3.0
_TRIES = 3


class Stopped(Exception):  # noqa: N818 - it is no error: somebody asked for it
    """The executor was asked to stop: episodes under way have no result."""


class NoWorkerError(Exception):
    """No worker process can be started. The message says why."""


class ForkServer:
    """Starts the worker processes of one setup, from any thread. The server process starts with the first worker.

    `is_ready` is True when workers can be started for some agents or all. On Linux workers are forked. On other
    systems, and when a plugin starts threads during its import, forking a process with loaded numerical libraries is
    not safe: there each worker is a new Python. `platform_check` refuses systems that can do neither.

    `check_loaded` is called when the server has loaded everything, and raises `UsageError` when the loaded code is not
    the requested code.
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
        """The process id of the server; None while no server runs."""
        return self._process.pid if self._process is not None else None

    @property
    def compiling(self) -> tuple[int, int]:
        """(done, total) of the functions being compiled: those that an agent waits for and that the cache lacked."""
        self._hear()
        return self._compiling

    def drives(self, agent: str) -> bool:
        """Return whether the agent can be driven; False while only other agents' kernels are compiled."""
        if self._drives is not None:
            self._hear()
        drives = self._drives
        return drives is None or agent in drives

    def start_worker(self, limits: Limits, agent: str, unwanted: Callable[[], bool]) -> WorkerProcess:
        """Start a worker process that can drive the agent.

        Raises `UsageError` for a setup that does not work, `NoWorkerError` when three attempts fail, and `Stopped` soon
        after `unwanted()` returns True.
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
        raise NoWorkerError(f"no worker process can be started: {problems[-1]}")

    def close(self) -> None:
        """End the server and all its workers. A second call does nothing."""
        with self._lock:
            self._stop()

    def _start(self, unwanted: Callable[[], bool]) -> None:
        """Start the server unless it runs. If a preloaded agent module breaks the server, preload no agent."""
        if self._process is not None and self._process.poll() is None:
            return
        self._stop()
        forks = self._launch(unwanted)
        if not forks and self._setup.preload_agents:
            self._setup = replace(self._setup, preload_agents=())
            self._stop()
            forks = self._launch(unwanted)
        if forks is None:
            raise NoWorkerError(f"the fork server, which starts the worker processes, {self._why_not_ready()}.")
        try:
            self._check_loaded()
        except UsageError:
            self._stop()
            raise
        self.is_ready = True

    def _launch(self, unwanted: Callable[[], bool]) -> bool | None:
        """Start a new server; return whether the server forks, or None when the server ended or was not ready in time.

        Until then the server reports how many functions it has compiled. Raises `UsageError`, `Stopped`.
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
        """Return what happened to a server that did not get ready: still running after the time limit, or dead."""
        assert self._process is not None
        try:
            self._process.wait(_EXIT_S)
        except subprocess.TimeoutExpired:
            return f"was not ready within {_READY_S:g} s"
        return "died while it was getting ready"

    def _hear(self) -> None:
        """Read the messages that the server has sent since it was ready; return at once."""
        if not self._lock.acquire(blocking=False):  # another thread starts a worker or the server
            return
        try:
            if self.is_ready and self._control is not None:
                with Connection(os.dup(self._control.fileno())) as connection:
                    while connection.poll():
                        self._note(json.loads(connection.recv_bytes()))
        except (OSError, EOFError):  # the server has died
            self._drives = None
        finally:
            self._lock.release()

    def _note(self, words: dict[str, Any]) -> None:
        self._compiling = tuple(words.get("compiling", self._compiling))
        if "forks" in words:
            self._drives = None if words["drives"] is None else frozenset(words["drives"])

    def _last_line(self) -> str:
        """Return a sentence with the last line that the server printed."""
        if self._log is None:
            return ""
        self._log.seek(0)
        lines = self._log.read()[-2000:].decode("utf-8", "replace").strip().splitlines()
        return f"Its last line: {lines[-1]}" if lines else "It printed nothing."

    def _stop(self) -> None:
        if self._control is not None:
            with suppress(OSError):
                self._control.shutdown(socket.SHUT_WR)
            self._control.close()
        if self._process is not None:
            try:  # a ready server first kills its workers; a loading server has none and does not listen
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
