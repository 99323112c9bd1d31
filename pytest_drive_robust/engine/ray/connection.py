"""A process that speaks with a Ray cluster, and what it says about our episodes."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.fork_server import Stopped
from pytest_drive_robust.engine.messages import refusal
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.rescore import bare_result
from pytest_drive_robust.store.record import CorruptRecordError, decode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.ray.worker import ClusterRequest
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["LOCAL", "ClusterConnection"]

LOCAL = "local"
"""The address of a cluster of our own on this machine, which ends with the run."""
_SAID_BYTES = 2_000
"""Of what the driver printed at its end."""
_SHUTDOWN_S = 15.0


class ClusterConnection:
    """Our end of one process of `ray.driver`; `cluster` are arguments of `ray.init`, with an `address`.

    `nodes` are cores and GPUs of every node. `is_lost` once the process ended unasked; nobody waits for it then.
    """

    def __init__(self, cluster: Mapping[str, object]) -> None:
        self.nodes: tuple[tuple[float, float], ...] = ()
        self.is_lost = False
        self._address = cluster["address"]
        self._pending: dict[int, tuple[EpisodeRequest, Future[EpisodeResult]]] = {}
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._closing = False
        self._has_ended = False
        self._refused: str | None = None
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process that writes it
        self._connection, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", "from pytest_drive_robust.engine.ray import driver; driver.main()"],
                stdin=theirs.fileno(),
                stdout=self._log,
                stderr=self._log,
                start_new_session=True,  # Ctrl-C is for us: we tell the process to end
                env=_environment(),
            )
        self._write(cluster)
        self._reader = threading.Thread(target=self._read_all, name="drive-robust-ray", daemon=True)
        self._reader.start()

    def send(
        self, request: EpisodeRequest, needs: tuple[float, float], cluster_request: ClusterRequest
    ) -> Future[EpisodeResult]:
        """Begin an episode that takes these cores and GPUs."""
        future: Future[EpisodeResult] = Future()
        number = next(self._numbers)
        with self._changed:
            if self._has_ended:
                self._give_up(request, future)
            else:
                self._pending[number] = request, future
        self._write((number, needs, cluster_request))
        return future

    def close(self, *, cancel: bool) -> None:
        """End the process, with `cancel` at once, and with it a cluster of our own."""
        with self._changed:
            if not cancel:
                self._changed.wait_for(lambda: not self._pending)
            self._closing = True
        self._write(None)
        try:
            self._process.wait(_SHUTDOWN_S)
        except subprocess.TimeoutExpired:
            with suppress(OSError):  # what Ray started below it ends, too
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._reader.join()
        self._connection.close()
        self._log.close()

    def _write(self, message: object) -> None:
        with suppress(OSError):  # it ended: the reader says so to everybody who waits
            self._connection.send(message)

    def _read_all(self) -> None:
        with suppress(OSError, EOFError):
            while True:
                self._read(*self._connection.recv())
        with self._changed:
            self._has_ended = True
            self.is_lost = self._refused is None
            pending, self._pending = self._pending, {}
            self._changed.notify_all()
        for request, future in pending.values():
            self._give_up(request, future)

    def _read(self, kind: str, number: int, content: Any) -> None:
        """Take a message of the driver (see `ray.driver`)."""
        if kind == "nodes":
            self.nodes = content
            return
        if kind == "no cluster":
            self._refused = _no_cluster(str(self._address), content)
            return
        with self._changed:
            request, future = self._pending.pop(number)
            self._changed.notify_all()
        if kind == "refused":
            future.set_exception(refusal(content))
        elif kind == "lost":
            future.set_result(_lost(request, content))
        else:
            try:
                future.set_result(decode_episode(content))
            except CorruptRecordError as error:
                future.set_result(_lost(request, str(error)))

    def _give_up(self, request: EpisodeRequest, future: Future[EpisodeResult]) -> None:
        """Answer for a process that ended."""
        if self._closing:
            future.set_exception(Stopped())
        elif self._refused is not None:
            future.set_exception(UsageError(self._refused))
        else:
            self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - _SAID_BYTES))
            said = " ".join(self._log.read().decode(errors="replace").split()[-60:])
            future.set_result(_lost(request, f"the connection to the cluster ended. {said}"))


def _no_cluster(address: str, problem: str) -> str:
    if address == LOCAL:
        return (
            f"Ray does not start on this machine: {problem}. Without a cluster, --drive-executor processes uses all "
            "cores of this machine."
        )
    return (
        f"no Ray cluster can be used at {address!r}: {problem}. Start one with 'ray start --head' and give its "
        "host:port as --drive-ray-address, or give 'local' to use this machine alone."
    )


def _environment() -> dict[str, str]:
    """Return the environment of the driver: this package is found there as it is here, Ray reports no usage."""
    package = str(Path(__file__).parents[3])
    path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path, "RAY_USAGE_STATS_ENABLED": "0"}


def _lost(request: EpisodeRequest, why: str) -> EpisodeResult:
    detail = f"the episode was lost on the cluster: {why}"
    return bare_result(
        request.route, request.episode, outcome=Outcome.INFRA_ERROR, end=End.SIMULATION_CRASHED, detail=detail
    )
