"""In a child process: wait for an episode, drive it, answer, put everything back."""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import struct
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from pytest_drive_robust.engine.frames import BrokenStreamError, Frame, read_frame, write_frame
from pytest_drive_robust.engine.shared_state import SharedState
from pytest_drive_robust.engine.wire import TOGETHER
from pytest_drive_robust.engine.worker.handler import RequestHandler
from pytest_drive_robust.engine.worker.leftovers import Leftovers, resident_bytes
from pytest_drive_robust.engine.worker.system import limit_memory
from pytest_drive_robust.engine.worker.watched_agent import CUT_OFF
from pytest_drive_robust.runner.episode.machine import machine_facts

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["Descriptors", "serve", "split_answer"]

_LENGTH = struct.Struct("<I")
_FATAL = (signal.SIGSEGV, signal.SIGFPE, signal.SIGABRT, signal.SIGBUS, signal.SIGILL)
_PRIVATE_FROM = 600
"""Our descriptors get numbers from here on, out of the way of code that closes the low ones."""


class Descriptors(NamedTuple):
    """The descriptors that a child gets: for messages, for what is printed, for faulthandler, of the board."""

    messages: int
    output: int
    faults: int
    board: int


def serve(channels: Descriptors, worker_setup: WorkerSetup, limits: Limits, registry: Registry) -> None:
    """Drive what is asked for until the other side closes the channel."""
    messages, faults = _private(channels.messages), _private(channels.faults)
    _redirect(channels.output)
    board = SharedState(channels.board)
    os.close(channels.board)
    limit_memory(limits.memory_bytes)
    driver = RequestHandler(worker_setup, registry, board, messages)
    leftovers = Leftovers((0, 1, 2, messages, faults))
    machine_facts()  # before an agent can change what numpy does
    own = os.getpid()

    def answer(token: bytes, kind: bytes, body: bytes, *, over: bool = True) -> None:
        if os.getpid() != own:  # the agent forked, and this is the copy: one answer is enough
            os._exit(0)
        notes = {
            "rss": resident_bytes(),
            "leftovers": [*(driver.put_back() if over else ()), *leftovers.found()],
        }
        try:
            write_frame(messages, Frame(kind, token, _joined(notes, body)))
        except OSError:
            os._exit(CUT_OFF)

    while True:
        try:
            request = read_frame(messages)
        except (BrokenStreamError, OSError):
            return
        if request is None:
            driver.close()
            return
        _tell_faults(faults)
        if request.kind == TOGETHER:
            driver.lockstep.drive_together(request, answer)
        else:
            answer(request.token, *driver.answer(request))


def split_answer(payload: bytes) -> tuple[Mapping[str, Any], bytes]:
    """The notes of an answer, and what was answered. Raises `ValueError` for anything else."""
    try:
        (length,) = _LENGTH.unpack_from(payload)
        notes = json.loads(payload[_LENGTH.size : _LENGTH.size + length])
        int(notes["rss"]), list(notes["leftovers"])
    except (struct.error, KeyError, TypeError) as error:
        raise ValueError(f"no answer: {error}") from error
    return notes, payload[_LENGTH.size + length :]


def _joined(notes: Mapping[str, Any], answer: bytes) -> bytes:
    text = json.dumps(notes).encode()
    return _LENGTH.pack(len(text)) + text + answer


def _tell_faults(fd: int) -> None:
    """Have the place of a fatal error written to `fd`, and nobody else's handler after ours: pygame installs some."""
    faulthandler.disable()
    for number in _FATAL:
        signal.signal(number, signal.SIG_DFL)
    faulthandler.enable(file=fd, all_threads=False)


def _private(number: int) -> int:
    """The same file under a high number that is closed on exec."""
    import fcntl

    try:
        moved = fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, _PRIVATE_FROM)
    except OSError:  # fewer descriptors are allowed
        return number
    os.close(number)
    return moved


def _redirect(output: int) -> None:
    """Make the descriptor the standard output and error; nothing is to be read."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    for source, target in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(source, target)
    os.close(nothing)
    os.close(output)
    sys.stdin = sys.__stdin__ = os.fdopen(0, closefd=False)  # type: ignore[misc]
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = os.fdopen(number, "w", 1, encoding="utf-8", errors="backslashreplace", closefd=False)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
