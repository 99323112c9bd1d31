"""One run of the official evaluator, watched from the outside until all its processes have ended."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.evaluator.guard import MARK, kill_marked, marked, read_process

_GUARD = Path(__file__).with_name("guard.py")
_SERVER_SIGN = b"-carla-rpc-port="
STOPPED = "stopped"
"""The `trouble` of an attempt that ended because `stop` was set."""
_POLL_S = 0.1
_LOOK_S = 2.0
_ENDING_S = 30.0


@dataclass(frozen=True, slots=True)
class Patience:
    """How long to wait, in seconds of wall time.

    `route_s` is the limit for a whole route. `silence_s` is the limit without a line of output, which agents print in
    every tick; it is longer than the evaluator's own limit of 600 s, so that the evaluator can report first. `server_s`
    is the limit with a dead server, which the evaluator may not notice.
    """

    route_s: float = 6 * 3600.0
    silence_s: float = 1200.0
    server_s: float = 15.0


@dataclass(frozen=True, slots=True)
class Attempt:
    """How an attempt ended: the evaluator's exit code, and in `trouble` why we ended it ourselves (else empty)."""

    code: int
    trouble: str
    wall_s: float


def attempt(
    command: Sequence[str],
    *,
    environment: Mapping[str, str],
    folder: Path,
    log: Path,
    patience: Patience,
    stop: threading.Event | None = None,
) -> Attempt:
    """Run the command in `folder`, with its output in `log`, until the command ends or runs out of `patience`.

    Ends early, with the trouble `STOPPED`, once `stop` is set. No process of the command is left when this returns.
    """
    mark = uuid.uuid4().hex
    started_s = time.monotonic()
    trouble = ""
    with log.open("ab") as output:
        guard = subprocess.Popen(
            [sys.executable, "-I", str(_GUARD), *command],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env={**environment, MARK: mark},
            start_new_session=True,
        )
    try:
        watch = _Watch(mark, log, patience, started_s)
        while guard.poll() is None and not trouble:
            trouble = STOPPED if stop is not None and stop.is_set() else watch.trouble()
            time.sleep(_POLL_S)
    finally:
        _end(guard, mark)
    return Attempt(guard.returncode, trouble, time.monotonic() - started_s)


class _Watch:
    def __init__(self, mark: str, log: Path, patience: Patience, now_s: float) -> None:
        self._mark = mark
        self._log = log
        self._patience = patience
        self._started_s = now_s
        self._spoke_s = now_s
        self._size = -1
        self._looked_s = now_s
        self._server_s: float | None = None

    def trouble(self) -> str:
        """Return why the attempt must end, or an empty text."""
        now_s = time.monotonic()
        if now_s - self._started_s > self._patience.route_s:
            return f"the route took longer than {self._patience.route_s:g} s"
        size = self._log.stat().st_size
        if size != self._size:
            self._size, self._spoke_s = size, now_s
        if now_s - self._spoke_s > self._patience.silence_s:
            return f"the evaluator said nothing for {self._patience.silence_s:g} s"
        look_s = min(_LOOK_S, self._patience.server_s)
        if now_s - self._looked_s >= look_s:
            self._looked_s = now_s
            if any(_SERVER_SIGN in read_process(pid, "cmdline") for pid in marked(self._mark)):
                self._server_s = now_s
        if self._server_s is not None and now_s - self._server_s > self._patience.server_s + look_s:
            return "the CARLA server died"
        return ""


def _end(guard: subprocess.Popen[bytes], mark: str) -> None:
    """End the guard, which kills all processes of the command; kill the rest here, in case the guard was killed."""
    assert guard.stdin is not None
    with contextlib.suppress(OSError):
        guard.stdin.close()
    try:
        guard.wait(_ENDING_S)
    except subprocess.TimeoutExpired:
        guard.kill()
        guard.wait()
    kill_marked(mark)
