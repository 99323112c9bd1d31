"""A process that speaks with a Ray cluster, and what it says about our episodes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.fork_server import refusal
from pytest_drive_robust.engine.frames import TOKEN_BYTES, BrokenStreamError, Frame, read_frame, write_frame
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
_GOODBYE_S = 15.0
_SHOWN_BYTES = 2000


class ClusterConnection:
    """Our end of one `ray_driver` process.

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
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                "from pytest_drive_robust.engine.ray import driver as ray_driver; ray_driver.main()",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,  # Ctrl-C is for us: we close the stream
            env=_environment(),
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        self._write(Frame(ray_driver.OPEN, bytes(TOKEN_BYTES), json.dumps(wanted).encode()))
        self._reader = threading.Thread(target=self._read_all, name="drive-robust-ray", daemon=True)
        self._reader.start()

    def send(
        self, request: EpisodeRequest, needs: tuple[float, float], cluster_request: bytes
    ) -> Future[EpisodeResult]:
        """Begin an episode; `cluster_request` is a pickled `Errand`."""
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
        self._write(Frame(ray_driver.DRIVE, number, ray_driver.NEEDS.pack(*needs) + cluster_request))
        return future

    def close(self, *, cancel: bool) -> None:
        """End the process, with `cancel` at once, and with it a cluster of our own."""
        with self._idle:
            if not cancel:
                self._idle.wait_for(lambda: not self._pending)
            self._closing = True
        with suppress(OSError):
            self._stdin.close()
        try:
            self._process.wait(_GOODBYE_S)
        except subprocess.TimeoutExpired:
            _kill_group(self._process)
        self._reader.join()
        self._stdout.close()
        self._log.close()

    def _write(self, frame: Frame) -> None:
        with suppress(OSError):  # it ended: the reader says so to everybody who waits
            write_frame(self._stdin.fileno(), frame)

    def _read_all(self) -> None:
        with suppress(OSError, BrokenStreamError):
            while (frame := read_frame(self._stdout.fileno())) is not None:
                self._read(frame)
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
                future.set_result(_lost(request, f"the connection to the cluster ended. {self._last_words()}"))

    def _read(self, frame: Frame) -> None:
        if frame.kind == ray_driver.CLUSTER:
            self.nodes = tuple((cores, gpus) for cores, gpus in json.loads(frame.payload))
            return
        if frame.kind == ray_driver.REFUSED:
            with self._idle:
                self._refused = _refusal(str(self._address), frame.payload.decode())
            return
        with self._idle:
            found = self._pending.pop(frame.token, None)
            self._idle.notify_all()
        if found is None:
            return
        request, future = found
        if frame.kind == ray_driver.RECORD:
            future.set_result(_read_record(request, frame.payload))
        elif frame.kind == ray_driver.UNUSABLE:
            future.set_exception(refusal(json.loads(frame.payload)))
        else:
            future.set_result(_lost(request, frame.payload.decode()))

    def _last_words(self) -> str:
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
    """For the driver and what it starts: this package is found there as it is here, and Ray does not phone home."""
    package = str(Path(__file__).parents[2])
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
    """The driver and what Ray started below it."""
    with suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
