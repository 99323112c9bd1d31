"""In the fork server's process: load everything that driving takes, drive nothing, and fork workers that do.

It has one thread and its own session, so that forking is safe and no Ctrl-C reaches it. It ends with the process that
started it, and takes every worker with it.
"""

from __future__ import annotations

import gc
import json
import os
import pickle
import signal
import socket
import struct
import sys
import time
from contextlib import suppress
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any, NoReturn

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.engine.messages import refusal_bytes
from pytest_drive_robust.engine.worker.serve import serve
from pytest_drive_robust.engine.worker.system import adopt_orphans, child_processes, die_with_parent, no_core_files
from pytest_drive_robust.engine.worker_process import Descriptors
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.routes import resolve_routes

if TYPE_CHECKING:
    from collections.abc import Callable

    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["serve_forks", "serve_in_new_python"]

_LARGEST_MESSAGE_BYTES = 1 << 16
_STATUS = struct.Struct("<i")
_POLL_S = 0.5
_ENDING_S = 2.0


def serve_forks(control: int, parent: int) -> NoReturn:
    """Serve the socket with this descriptor until its other end is closed or the process `parent` is gone.

    Standard input has the `WorkerSetup`.
    """
    setup: WorkerSetup = pickle.load(sys.stdin.buffer)
    with socket.socket(fileno=control) as channel:
        try:
            registry = _loaded(setup, lambda done, total: _say(channel, {"compiling": [done, total]}))
        except UsageError as error:
            channel.sendall(refusal_bytes(error) + b"\n")
            os._exit(0)
        no_core_files()
        adopt_orphans()
        gc.collect()
        gc.freeze()  # what is shared with the workers is not touched by their collectors
        forks = sys.platform == "linux" and len(os.listdir("/proc/self/task")) <= setup.threads
        _say(channel, {"forks": forks})
        _Server(channel, setup, registry, forks=forks).run(parent)
    os._exit(0)


def serve_in_new_python(messages: int, output: int, faults: int, state: int, parent: int) -> NoReturn:
    """Serve as a worker that was not forked. Standard input has the `WorkerSetup` and the `Limits`."""
    setup, limits = pickle.load(sys.stdin.buffer)
    _be_worker_of(parent)
    registry = setup.registry()
    setup.limit_threads()
    serve(Descriptors(messages, output, faults, state), setup, limits, registry)
    os._exit(0)


class _Server:
    """Starts workers on request, and tells of each when it began and how it ended."""

    def __init__(self, control: socket.socket, worker_setup: WorkerSetup, registry: Registry, *, forks: bool) -> None:
        self._control = control
        self._setup = worker_setup
        self._registry = registry
        self._forks = forks
        self._exits: dict[int, int] = {}  # by worker: where its end is told
        self._pid = os.getpid()

    def run(self, parent: int) -> None:
        """Run until nobody wants workers any more."""
        wake_r, wake_w = os.pipe()
        os.set_blocking(wake_r, False)
        os.set_blocking(wake_w, False)
        signal.set_wakeup_fd(wake_w, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        while os.getppid() == parent:
            ready = wait([self._control, wake_r], _POLL_S)
            if wake_r in ready:
                os.read(wake_r, 1024)
            self._reap()
            if self._control in ready and not self._start_worker(wake_r, wake_w):
                break
        self._end()

    def _start_worker(self, *own: int) -> bool:
        """Answer one request; False when there will be no more. A forked worker closes the descriptors `own`."""
        data, fds, _, _ = socket.recv_fds(self._control, _LARGEST_MESSAGE_BYTES, 1 + len(Descriptors._fields))
        if not data:
            return False
        limits: Limits = pickle.loads(data)
        exit_w, descriptors = fds[0], Descriptors(*fds[1:])
        if self._forks:
            pid = os.fork()
            if pid == 0:
                self._be_worker((*own, exit_w), descriptors, limits)
        else:
            arguments, content = (*descriptors, self._pid), (self._setup, limits)
            process = self._setup.start_python(
                "serve_in_new_python", arguments, content, pass_fds=descriptors, output=descriptors.output
            )
            process.returncode = 0  # its end is ours to notice, not that of the next `Popen`
            pid = process.pid
        for number in descriptors:
            os.close(number)
        self._exits[pid] = exit_w
        _tell(exit_w, pid)
        return True

    def _be_worker(self, own: tuple[int, ...], descriptors: Descriptors, limits: Limits) -> NoReturn:
        try:
            os.setsid()
            signal.set_wakeup_fd(-1)
            _be_worker_of(self._pid)
            self._control.close()
            for number in (*own, *self._exits.values()):
                os.close(number)
            serve(descriptors, self._setup, limits, self._registry)
        except BaseException:
            import traceback

            traceback.print_exc()
            os._exit(70)
        os._exit(0)

    def _reap(self) -> None:
        """Tell of the workers that ended, and kill what they left."""
        with suppress(ChildProcessError):
            while True:
                pid, status = os.waitpid(-1, os.WNOHANG)
                if not pid:
                    return
                if pid in self._exits:
                    _kill(os.killpg, pid)  # the number of a group is not free before its last member has ended
                    exit_w = self._exits.pop(pid)
                    _tell(exit_w, status)
                    os.close(exit_w)
                    self._kill_orphans()

    def _kill_orphans(self) -> None:
        """Kill what a worker started outside its group: it belongs to us when the worker is dead."""
        for pid in child_processes():
            if pid not in self._exits:
                _kill(os.kill, pid)

    def _end(self) -> None:
        for pid in self._exits:
            _kill(os.killpg, pid)
        deadline = time.monotonic() + _ENDING_S
        while (self._exits or child_processes()) and time.monotonic() < deadline:
            self._reap()
            self._kill_orphans()
            time.sleep(0.005)


def _be_worker_of(server: int) -> None:
    """End with the server; adopt what sub-processes of the agent leave; take signals as a new process does."""
    die_with_parent(server)
    adopt_orphans()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # pytest may have been started to ignore it


def _loaded(setup: WorkerSetup, tell: Callable[[int, int], None]) -> Registry:
    """Import everything and compile what the cache lacks; `tell(done, total)` hears of functions being compiled."""
    registry = setup.registry()
    registry.require("simulators", setup.simulator)
    for name in setup.preload_agents:
        with suppress(UsageError):  # the worker that needs it says so
            registry.require("agents", name)
    if setup.simulator == "embedded":
        from pytest_drive_robust.simulators.embedded.compiling import compile_kernels  # loads numba

        compile_kernels(tell)
        _warm_up(registry, setup)
    setup.limit_threads()
    return registry


def _say(channel: socket.socket, words: dict[str, object]) -> None:
    """Tell the process that started us something, as a line of JSON."""
    channel.sendall(json.dumps(words).encode() + b"\n")


def _warm_up(registry: Registry, setup: WorkerSetup) -> None:
    """Load the compiled kernels once for all workers."""
    simulator = registry.simulator(setup.simulator, setup.options)
    simulator.reset(resolve_routes("dev10")[0], seed=0, cameras=(CameraSpec("front", width_px=64, height_px=32),))
    for _ in range(2):
        simulator.observe()
        simulator.truth()
        simulator.step(Control.NEUTRAL)
    simulator.score()
    simulator.close()


def _tell(exit_w: int, number: int) -> None:
    with suppress(OSError):  # nobody waits for it any more
        os.write(exit_w, _STATUS.pack(number))


def _kill(send: Any, pid: int) -> None:
    with suppress(OSError):
        send(pid, signal.SIGKILL)
