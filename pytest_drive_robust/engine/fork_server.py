"""Where child processes come from: forked from a process that has loaded everything, or started afresh."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import IO, TYPE_CHECKING, Any

from pytest_drive_robust import errors
from pytest_drive_robust.engine.cradle import Adopted, knock
from pytest_drive_robust.engine.frames import TOKEN_BYTES, Frame
from pytest_drive_robust.engine.shared_state import SharedState, shared_file, state_bytes
from pytest_drive_robust.engine.worker.serve import Descriptors
from pytest_drive_robust.engine.worker_process import ForkedChild, SpawnedChild

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_process import WorkerProcess
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["ForkServer", "NoWorkerError", "Stopped", "refusal"]

_START = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from pytest_drive_robust.engine.worker import forking; forking.{0}"  # noqa: E501
_READY_S = 600.0
"""Kernels may have to be compiled first."""
_FORK_S = 30.0
_LOOK_S = 0.1
_TRIES = 3


class Stopped(Exception):  # noqa: N818 - it is no error: somebody asked for it
    """Somebody asked to stop: what was under way has no result."""


class NoWorkerError(Exception):
    """No child can be had. The message says why."""


class ForkServer:
    """Makes child processes of a worker_setup; from any thread. Nothing is started before the first one is asked for.

    On Linux children are forked. Elsewhere forking a process that has loaded numerical libraries is not safe, and each
    child is a new Python; so it is where a plugin starts threads while it is imported. Raises `UsageError` on systems
    without either.
    """

    def __init__(self, worker_setup: WorkerSetup, *, fork: bool | None = None) -> None:
        if os.name != "posix":
            raise errors.UsageError(
                "guarded processes need Linux or macOS (on Windows: inside WSL). Give --drive-executor inline."
            )
        self._setup = worker_setup
        self._fork = sys.platform == "linux" if fork is None else fork
        self._preload = worker_setup.preload_agents
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | Adopted | None = None
        self._channel: socket.socket | None = None
        self._log: IO[bytes] | None = None
        self._ready = False

    @property
    def pid(self) -> int | None:
        """The process that forks, while there is one."""
        return self._process.pid if self._process is not None else None

    def child(self, limits: Limits, unwanted: Callable[[], bool] = lambda: False) -> WorkerProcess:
        """A new child process.

        Raises `UsageError` for a setup that does not work, `NoWorkerError`, and `Stopped` soon after `unwanted()`
        has become true: getting ready may take a minute where kernels have to be compiled.
        """
        problem = ""
        for _ in range(_TRIES):
            with self._lock:
                if unwanted():
                    raise Stopped
                try:
                    if self._fork:
                        self._start(unwanted)
                    return self._forked(limits) if self._fork else self._spawned(limits)
                except (OSError, NoWorkerError) as error:
                    problem = f"{error} {self._said()}"
                    self._stop()
        raise NoWorkerError(f"no process for the episode can be started: {problem}")

    def close(self) -> None:
        """End the process that forks, and with it every child. Calling it twice does no harm."""
        with self._lock:
            self._stop()

    def _start(self, unwanted: Callable[[], bool]) -> None:
        """Start the process that forks, unless it runs. An agent module that breaks it is left to the children."""
        if self._process is not None and self._process.poll() is None:
            return
        self._stop()
        ready = self._launch(unwanted)
        if self._preload and (ready is None or ready > self._setup.threads):
            self._preload = ()
            self._stop()
            ready = self._launch(unwanted)
        if ready is None:
            raise NoWorkerError("the process that starts all others died while it was getting ready.")
        self._ready = True
        if ready > self._setup.threads:
            self._stop()
            self._fork = False

    def _launch(self, unwanted: Callable[[], bool]) -> int | None:
        """Threads of the new process, None when it died while it was getting ready. Raises `UsageError`, `Stopped`."""
        told = None
        for begin in (self._knock, self._begin):
            if begin():
                told = self._answer(unwanted)
                if told is not None:
                    break
                self._stop()
        if told is None:
            return None
        if "type" in told:
            self._stop()
            raise refusal(told)
        return int(told["threads"])

    def _knock(self) -> bool:
        """Have a fork_server forked from the cradle of the run. False when there is none."""
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        worker_setup = replace(self._setup, preload_agents=self._preload)
        self._channel = knock(worker_setup, self._log.fileno())
        return self._channel is not None

    def _begin(self) -> bool:
        """Start a fork_server afresh. False when it was dead at once."""
        if self._log is None:
            self._log = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = self._popen("main", (theirs.fileno(),), self._log.fileno())
        try:
            self._channel.send(pickle.dumps(replace(self._setup, preload_agents=self._preload)))
        except OSError:
            return False
        return True

    def _answer(self, unwanted: Callable[[], bool]) -> dict[str, Any] | None:
        """What the process said when it was ready, None when it died before. Raises `Stopped`."""
        assert self._channel is not None
        deadline = time.monotonic() + _READY_S
        while True:
            while not select.select([self._channel], [], [], _LOOK_S)[0]:
                if unwanted():
                    self._stop()
                    raise Stopped
                if time.monotonic() > deadline:
                    return None
            try:
                answer = self._channel.recv(1 << 16)
            except OSError:
                return None
            if not answer:
                return None
            told: dict[str, Any] = json.loads(answer)
            if "pid" not in told:
                return told
            self._process = Adopted(self._channel, told["pid"])

    def _popen(self, entry: str, fds: tuple[int, ...], output: int) -> subprocess.Popen[bytes]:
        code = f"{_START.format(entry)}({', '.join(map(str, fds))})"
        return subprocess.Popen(
            [sys.executable, "-c", code, json.dumps(self._setup.python_path)],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            pass_fds=fds,
            env=self._setup.environment(),
            cwd=self._setup.folder,
            start_new_session=True,
        )

    def _forked(self, limits: Limits) -> WorkerProcess:
        assert self._channel is not None
        with _Ends(self._setup.options.tick_cap) as ends:
            status_r, status_w = os.pipe()
            ends.mine.append(status_r)
            try:
                socket.send_fds(self._channel, [pickle.dumps(limits)], [status_w, *ends.theirs])
            finally:
                os.close(status_w)
            if not select.select([status_r], [], [], _FORK_S)[0]:
                raise TimeoutError(f"it did not fork within {_FORK_S:g} s")
            told = os.read(status_r, 4)
            if len(told) < 4:
                raise ConnectionError("it died instead of forking")
            pid = int.from_bytes(told, "little", signed=True)
            return ForkedChild(pid, ends.taken(), status_r)

    def _spawned(self, limits: Limits) -> WorkerProcess:
        with _Ends(self._setup.options.tick_cap) as ends:
            process = self._popen("spawned", ends.theirs, ends.theirs.output)
            child = SpawnedChild(process, ends.taken())
        try:
            child.send(Frame(b"I", bytes(TOKEN_BYTES), pickle.dumps((self._setup, limits))))
        except OSError as error:
            child.kill()
            child.close()
            raise NoWorkerError(f"a new Python for the episode died at once: {error}") from error
        return child

    def _said(self) -> str:
        """What the process printed last."""
        if self._log is None:
            return ""
        self._log.seek(0)
        lines = self._log.read()[-2000:].decode("utf-8", "replace").strip().splitlines()
        return f"It said: {lines[-1]}" if lines else "It said nothing."

    def _stop(self) -> None:
        if self._channel is not None:
            with contextlib.suppress(OSError):
                self._channel.shutdown(socket.SHUT_WR)
            self._channel.close()
        if self._process is not None:
            if not self._ready:
                self._process.kill()  # it would not look up from its work, and has no children yet
            try:
                self._process.wait(3.0)  # it kills its children first
            except subprocess.TimeoutExpired:
                with contextlib.suppress(OSError):
                    os.killpg(self._process.pid, 9)
                self._process.wait()
        if self._log is not None:
            self._log.close()
        self._channel = self._process = self._log = None
        self._ready = False


class _Ends:
    """Both ends of what connects a child with us. Theirs are closed at the end, ours unless they were taken."""

    def __init__(self, tick_cap: int) -> None:
        ours, theirs = socket.socketpair()
        output_r, output_w = os.pipe()
        faults = shared_file("faults", 0)
        board = shared_file("board", state_bytes(tick_cap))
        self.theirs = Descriptors(theirs.detach(), output_w, faults, board)
        self.mine = [ours.detach(), output_r, os.dup(faults)]

    def __enter__(self) -> _Ends:
        return self

    def taken(self) -> tuple[Descriptors, SharedState]:
        """Our ends, now the caller's."""
        messages, output, faults = self.mine[:3]
        board = SharedState(self.theirs.board)
        self.mine.clear()
        return Descriptors(messages, output, faults, -1), board

    def __exit__(self, *_: object) -> None:
        for number in (*self.theirs, *self.mine):
            os.close(number)


def refusal(told: Mapping[str, str]) -> errors.UsageError:
    """The usage error that another process ran into, of the same class."""
    kind = getattr(errors, told["type"], errors.UsageError)
    if not (isinstance(kind, type) and issubclass(kind, errors.UsageError)):
        kind = errors.UsageError
    return kind(told["text"])
