"""A process that speaks with a Ray cluster, and what it says about our episodes."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, TYPE_CHECKING

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.messages import TOKEN_BYTES, Message, receive, refusal, send
from pytest_drive_robust.engine.ray import driver as ray_driver
from pytest_drive_robust.engine.supervisor import Stopped
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.rescore import bare_result
from pytest_drive_robust.store.record import CorruptRecordError, decode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["LOCAL", "ClusterConnection"]

LOCAL = "local"
"""The address of a cluster of our own on this machine, which ends with the run."""
_SHUTDOWN_S = 15.0
_SHOWN_BYTES = 2000


class ClusterConnection:
    """Our end of one process of `ray.driver`.

    `nodes` are cores and GPUs of every node. `is_lost` once the process ended unasked; nobody waits for it then.
    """

    def __init__(self, wanted: Mapping[str, object]) -> None:
        self.nodes: tuple[tuple[float, float], ...] = ()
        self.is_lost = False
        self._address = wanted["address"]
        self._pending: dict[bytes, tuple[EpisodeRequest, Future[EpisodeResult]]] = {}
        self._sent = 0
        self._idle = threading.Condition()
        self._closing = False
        self._refused: str | None = None
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process that writes it
        self._connection, theirs = Pipe()
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                "from pytest_drive_robust.engine.ray import driver; driver.main()",
            ],
            stdin=theirs.fileno(),
            stdout=self._log,
            stderr=self._log,
            start_new_session=True,  # Ctrl-C is for us: we close the connection
            env=_environment(),
        )
        theirs.close()
        self._write(Message(ray_driver.OPEN, bytes(TOKEN_BYTES), json.dumps(wanted).encode()))
        self._reader = threading.Thread(target=self._read_all, name="drive-robust-ray", daemon=True)
        self._reader.start()

    def send(
        self, request: EpisodeRequest, needs: tuple[float, float], cluster_request: bytes
    ) -> Future[EpisodeResult]:
        """Begin an episode; `cluster_request` is a pickled `ClusterRequest`."""
        future: Future[EpisodeResult] = Future()
        with self._idle:
            if self.is_lost:
                future.set_result(_lost(request, "the connection to the cluster ended."))
                return future
            if self._refused is not None:
                future.set_exception(UsageError(self._refused))
                return future
            self._sent += 1
            number = self._sent.to_bytes(TOKEN_BYTES, "big")
            self._pending[number] = request, future
        self._write(Message(ray_driver.DRIVE, number, ray_driver.NEEDS.pack(*needs) + cluster_request))
        return future

    def close(self, *, cancel: bool) -> None:
        """End the process, with `cancel` at once, and with it a cluster of our own."""
        with self._idle:
            if not cancel:
                self._idle.wait_for(lambda: not self._pending)
            self._closing = True
        with suppress(OSError):
            _shut_down(self._connection)
        try:
            self._process.wait(_SHUTDOWN_S)
        except subprocess.TimeoutExpired:
            _kill_group(self._process)
        self._reader.join()
        self._connection.close()
        self._log.close()

    def _write(self, message: Message) -> None:
        with suppress(OSError):  # it ended: the reader says so to everybody who waits
            send(self._connection, message)

    def _read_all(self) -> None:
        with suppress(OSError, EOFError, ValueError):
            while True:
                self._read(receive(self._connection))
        with self._idle:
            self.is_lost = self._refused is None
            pending, self._pending = self._pending, {}
            self._idle.notify_all()
        for request, future in pending.values():
            if self._closing:
                future.set_exception(Stopped())
            elif self._refused is not None:
                future.set_exception(UsageError(self._refused))
            else:
                future.set_result(_lost(request, f"the connection to the cluster ended. {self._last_output()}"))

    def _read(self, message: Message) -> None:
        if message.kind == ray_driver.CLUSTER:
            self.nodes = tuple((cores, gpus) for cores, gpus in json.loads(message.payload))
            return
        if message.kind == ray_driver.REFUSED:
            with self._idle:
                self._refused = _refusal(str(self._address), message.payload.decode())
            return
        with self._idle:
            found = self._pending.pop(message.token, None)
            self._idle.notify_all()
        if found is None:
            return
        request, future = found
        if message.kind == ray_driver.RECORD:
            future.set_result(_read_record(request, message.payload))
        elif message.kind == ray_driver.UNUSABLE:
            future.set_exception(refusal(message.payload))
        else:
            future.set_result(_lost(request, message.payload.decode()))

    def _last_output(self) -> str:
        size = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, size - _SHOWN_BYTES))
        return " ".join(self._log.read().decode(errors="replace").split()[-60:])


def _refusal(address: str, problem: str) -> str:
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


def _read_record(request: EpisodeRequest, record: bytes) -> EpisodeResult:
    try:
        return decode_episode(record)
    except CorruptRecordError as error:
        return _lost(request, str(error))


def _lost(request: EpisodeRequest, why: str) -> EpisodeResult:
    detail = f"the episode was lost on the cluster: {why}"
    return bare_result(
        request.route, request.episode, outcome=Outcome.INFRA_ERROR, end=End.SIMULATION_CRASHED, detail=detail
    )


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill the driver and what Ray started below it."""
    with suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _shut_down(connection: Connection) -> None:
    """Tell the other side that nothing will come any more, while our reader still reads."""
    with socket.socket(fileno=os.dup(connection.fileno())) as other:
        other.shutdown(socket.SHUT_WR)
