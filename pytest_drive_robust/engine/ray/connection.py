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
from concurrent.futures import Future, wait
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path
from typing import IO, TYPE_CHECKING

from pytest_drive_robust.engine.fork_server import Stopped
from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.ray.worker import ClusterRequest

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
        self._pending: dict[int, tuple[ClusterRequest, Future[EpisodeResult]]] = {}
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._closing = False
        self._has_ended = False
        self._refused: UsageError | None = None
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

    def send(self, asked: ClusterRequest, needs: tuple[float, float]) -> Future[EpisodeResult]:
        """Begin an episode that takes these cores and GPUs."""
        future: Future[EpisodeResult] = Future()
        number = next(self._numbers)
        with self._lock:
            self._pending[number] = asked, future
        self._write((number, needs, asked))
        if self._has_ended:
            self._give_up()
        return future

    def close(self, *, cancel: bool) -> None:
        """End the process, with `cancel` at once, and with it a cluster of our own."""
        if not cancel:
            wait([future for _, future in self._pending.values()])
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
        """Take what the driver says (see `ray.driver`) until it ends, and answer for it then."""
        with suppress(OSError, EOFError):
            while True:
                number, content = self._connection.recv()
                if number is not None:
                    with self._lock:
                        _, future = self._pending.pop(number)
                    _settle(future, content)
                elif isinstance(content, str):
                    self._refused = _no_cluster(str(self._address), content)
                else:
                    self.nodes = content
        self.is_lost = self._refused is None
        self._has_ended = True
        self._give_up()

    def _give_up(self) -> None:
        """Answer for a process that ended."""
        with self._lock:
            pending, self._pending = self._pending, {}
        for asked, future in pending.values():
            if self._closing:
                future.set_exception(Stopped())
            else:
                _settle(future, self._refused or asked.lost(f"the connection to the cluster ended. {self._said()}"))

    def _said(self) -> str:
        """Return the last words of the process."""
        self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - _SAID_BYTES))
        return " ".join(self._log.read().decode(errors="replace").split()[-60:])


def _settle(future: Future[EpisodeResult], content: EpisodeResult | UsageError) -> None:
    if isinstance(content, UsageError):
        future.set_exception(content)
    else:
        future.set_result(content)


def _no_cluster(address: str, problem: str) -> UsageError:
    if address == LOCAL:
        return UsageError(
            f"Ray does not start on this machine: {problem}. Without a cluster, --drive-executor processes uses all "
            "cores of this machine."
        )
    return UsageError(
        f"no Ray cluster can be used at {address!r}: {problem}. Start one with 'ray start --head' and give its "
        "host:port as --drive-ray-address, or give 'local' to use this machine alone."
    )


def _environment() -> dict[str, str]:
    """Return the environment of the driver: this package is found there as it is here, Ray reports no usage."""
    package = str(Path(__file__).parents[3])
    path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path, "RAY_USAGE_STATS_ENABLED": "0"}
