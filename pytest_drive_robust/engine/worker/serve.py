"""The loop of a worker process: wait for a request, drive its episode, answer, restore the process."""

from __future__ import annotations

import faulthandler
import fcntl
import os
import signal
import sys
from collections.abc import Iterable, Sequence
from multiprocessing.connection import Connection

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.messages import answer_bytes, receive
from pytest_drive_robust.engine.shared_state import CUT_OFF, SharedState
from pytest_drive_robust.engine.worker.handler import RequestHandler
from pytest_drive_robust.engine.worker.loaded_code import LoadedCode
from pytest_drive_robust.engine.worker.process_state import (
    Leftovers,
    add_late_modules,
    read_process_state,
    restore_process_state,
)
from pytest_drive_robust.engine.worker.system import limit_memory
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.episode import contract
from pytest_drive_robust.runner.episode.machine import machine_facts

_FATAL = (signal.SIGSEGV, signal.SIGFPE, signal.SIGABRT, signal.SIGBUS, signal.SIGILL)
_PRIVATE_FROM = 600
"""Lowest number of our own descriptors: code that closes low descriptors does not reach them."""


def serve(
    inherited: Sequence[int],
    worker_setup: WorkerSetup,
    limits: Limits,
    registry: Registry,
    *,
    loaded: Iterable[str] = (),
) -> None:
    """Answer requests until the supervisor closes the connection. `inherited`: see `WorkerProcess`.

    `loaded` names the modules that the fork server had loaded.
    """
    messages, output, memory = inherited
    connection, faults = Connection(_private(messages)), _private(os.dup(output))
    _redirect(output)
    state = SharedState(memory, connection=connection.fileno())
    os.close(memory)
    contract.BLAMED = (BaseException,)
    limit_memory(limits.memory_bytes)
    code = LoadedCode(dict(worker_setup.sources), loaded)
    handler = RequestHandler(worker_setup, registry, state, connection, code)
    start = read_process_state()
    add_late_modules(start)
    leftovers = Leftovers((0, 1, 2, connection.fileno(), faults), growth_bytes=limits.growth_bytes)
    machine_facts()  # before an agent can change numpy's settings
    own = os.getpid()
    while True:
        try:
            token, payload = receive(connection)
        except EOFError:
            handler.close()
            return
        except (OSError, ValueError):
            return
        _tell_faults(faults)
        for reply in handler.replies(token, payload):
            if os.getpid() != own:  # a copy that the agent forked must not answer, too
                os._exit(0)
            is_as_before = restore_process_state(start) if reply.is_last else True
            is_broken = getattr(reply.result, "outcome", None) is Outcome.INFRA_ERROR
            is_spent = leftovers.found() or is_broken or not is_as_before
            try:
                connection.send_bytes(reply.token + answer_bytes(reply.result, is_spent=is_spent))
            except OSError:
                os._exit(CUT_OFF)


def _tell_faults(fd: int) -> None:
    """Let faulthandler write the line of a fatal error to `fd`; remove other handlers, such as pygame's."""
    faulthandler.disable()
    for number in _FATAL:
        signal.signal(number, signal.SIG_DFL)
    faulthandler.enable(file=fd, all_threads=False)


def _private(number: int) -> int:
    """Move a descriptor to a high number and close it on exec; return the new number."""
    try:
        moved = fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, _PRIVATE_FROM)
    except OSError:  # fewer descriptors are allowed
        return number
    os.close(number)
    return moved


def _redirect(output: int) -> None:
    """Make `output` the standard output and standard error; make the standard input empty."""
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
