"""Runs in the fork server: loads everything that driving needs, drives nothing itself, and forks the workers.

The fork server has one thread and its own session, so that forking is safe and no Ctrl-C arrives. The fork server ends
with the process that started it, and all workers end with the fork server.
"""

from __future__ import annotations

import functools
import gc
import json
import os
import pickle
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, NoReturn

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.engine.messages import refusal_bytes
from pytest_drive_robust.engine.worker.serve import serve
from pytest_drive_robust.engine.worker.system import (
    adopt_orphans,
    child_processes,
    die_with_parent,
    no_core_files,
    outlive_starter,
)
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.simulators.routes import resolve_routes

if TYPE_CHECKING:
    from pytest_drive_robust.jit.compile_all import Compilation

_LARGEST_MESSAGE_BYTES = 1 << 16
_MOST_DESCRIPTORS = 8
_POLL_S = 0.02
"""Seconds between two looks for ended workers."""
_ENDING_S = 2.0


def serve_forks(control: int, parent: int) -> NoReturn:
    """Serve the socket `control` until its other end or the process `parent` is gone. The setup is at stdin."""
    setup: WorkerSetup = pickle.load(sys.stdin.buffer)
    if sys.platform == "linux":  # on other systems that starts a thread
        die_with_parent(parent)  # an import may take long, or hang
    with socket.socket(fileno=control) as channel:
        try:
            registry, compilation = _loaded(setup, lambda done, total: _say(channel, {"compiling": [done, total]}))
        except UsageError as error:
            _send(channel, refusal_bytes(error))
            os._exit(0)
        no_core_files()
        adopt_orphans()
        outlive_starter()
        _Server(channel, setup, registry, compilation).run(parent)
    os._exit(0)


def serve_in_new_python(*numbers: int) -> NoReturn:
    """Serve as a worker in a new Python. Read `WorkerSetup` and `Limits` from stdin.

    `numbers` are the descriptors that the worker inherits, then the process id of the fork server.
    """
    setup, limits = pickle.load(sys.stdin.buffer)
    *inherited, parent = numbers
    _be_worker_of(parent)
    registry = setup.registry()
    setup.limit_threads()
    serve(inherited, setup, limits, registry)
    os._exit(0)


class _Server:
    """Starts workers on request, and reports the process id and the exit status of each."""

    def __init__(
        self, control: socket.socket, worker_setup: WorkerSetup, registry: Registry, compilation: Compilation | None
    ) -> None:
        self._control = control
        self._setup = worker_setup
        self._registry = registry
        self._compilation = compilation
        self._exits: dict[int, int] = {}  # by process id: the descriptor for the exit status
        self._pid = os.getpid()

    def run(self, parent: int) -> None:
        """Serve requests until the control socket is closed or the parent process has ended."""
        self._tell_ready()
        while os.getppid() == parent:
            ready = wait([self._control, *self._progress_fds()], _POLL_S)
            self._reap()
            if any(number in ready for number in self._progress_fds()):
                self._read_compilers()
            if self._control in ready and not self._start_worker():
                break
        self._end()

    def _progress_fds(self) -> tuple[int, ...]:
        """Return the descriptor of messages from compiling processes; empty when none compiles."""
        number = None if self._compilation is None else self._compilation.progress_fd
        return () if number is None else (number,)

    def _read_compilers(self) -> None:
        """Read the progress of the compiling processes; when all have ended, load the kernels for later workers."""
        assert self._compilation is not None
        self._compilation.read_progress()
        if self._compilation.progress_fd is None:
            self._compilation = None
            _warm_up(self._registry, self._setup, cameras=True)
            self._setup.limit_threads()
            self._tell_ready()

    def _tell_ready(self) -> None:
        """Send whether workers are forked, and which agents can be driven (None for all agents)."""
        gc.collect()
        gc.freeze()  # a worker's garbage collector must not copy the pages shared with this process
        self._forks = sys.platform == "linux" and len(os.listdir("/proc/self/task")) <= self._setup.threads
        drives = None if self._compilation is None else self._setup.preload_agents[:1]
        _say(self._control, {"forks": self._forks, "drives": drives})

    def _start_worker(self) -> bool:
        """Start a worker for one request; return False when the control socket is closed."""
        data, fds, _, _ = socket.recv_fds(self._control, _LARGEST_MESSAGE_BYTES, _MOST_DESCRIPTORS)
        if not data:
            return False
        limits: Limits = pickle.loads(data)
        exit_w, *inherited = fds
        if self._forks:
            pid = os.fork()
            if pid == 0:
                self._be_worker(exit_w, inherited, limits)
        else:
            arguments, content = (*inherited, self._pid), (self._setup, limits)
            process = self._setup.start_python(
                "serve_in_new_python", arguments, content, pass_fds=inherited, output=inherited[1]
            )
            process.returncode = 0  # `_reap` waits for it, not the next `Popen`
            pid = process.pid
        for number in inherited:
            os.close(number)
        self._exits[pid] = exit_w
        _tell(exit_w, pid)
        return True

    def _be_worker(self, exit_w: int, inherited: Sequence[int], limits: Limits) -> NoReturn:
        try:
            os.setsid()
            _be_worker_of(self._pid)
            self._control.close()
            for number in (exit_w, *self._exits.values(), *self._progress_fds()):  # only the fork server reports an end
                os.close(number)
            serve(inherited, self._setup, limits, self._registry, loaded=tuple(sys.modules))
        except BaseException:
            traceback.print_exc()
            os._exit(70)
        os._exit(0)

    def _reap(self) -> None:
        """Report the exit status of ended workers, and kill the processes that they left."""
        with suppress(ChildProcessError):
            while True:
                pid, status = os.waitpid(-1, os.WNOHANG)
                if not pid:
                    return
                if pid in self._exits:
                    _kill(os.killpg, pid)  # safe: a group's number stays taken until its last member ends
                    exit_w = self._exits.pop(pid)
                    _tell(exit_w, status)
                    os.close(exit_w)
                    self._kill_orphans()

    def _kill_orphans(self) -> None:
        """Kill processes that a dead worker started outside its group: this process has adopted them."""
        compilers = () if self._compilation is None else self._compilation.children
        for pid in child_processes():
            if pid not in self._exits and pid not in compilers:
                _kill(os.kill, pid)

    def _end(self) -> None:
        self._compilation = None  # ends the compiling processes
        for pid in self._exits:
            _kill(os.killpg, pid)
        deadline = time.monotonic() + _ENDING_S
        while (self._exits or child_processes()) and time.monotonic() < deadline:
            self._reap()
            self._kill_orphans()
            time.sleep(0.005)


def _be_worker_of(server: int) -> None:
    """Make this worker end with the fork server, adopt orphans of the agent's sub-processes, and react to SIGINT."""
    die_with_parent(server)
    adopt_orphans()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # pytest may have been started with SIGINT ignored


def _loaded(setup: WorkerSetup, tell: Callable[[int, int], None]) -> tuple[Registry, Compilation | None]:
    """Import everything and compile the kernels of the setup's first agent.

    Returns the registry, and the compilation of other kernels that still runs, or None. `tell(done, total)` is called
    with the number of compiled functions that an agent waits for.
    """
    registry = setup.registry()
    registry.require("simulators", setup.simulator)
    compilation = None
    if setup.simulator == "embedded":
        from pytest_drive_robust.simulators.embedded.compiling import begin_compiling  # loads numba

        _import_agents(registry, setup.preload_agents[:1])
        others = functools.partial(_import_agents, registry, setup.preload_agents[1:])
        cameras = not setup.preload_agents or _may_have_cameras(registry, setup.preload_agents[0])
        compilation = begin_compiling(others, tell, cameras=cameras)
        _warm_up(registry, setup, cameras=cameras)
    else:
        _import_agents(registry, setup.preload_agents)
    setup.limit_threads()
    return registry, compilation if compilation is not None and compilation.progress_fd is not None else None


def _import_agents(registry: Registry, names: Sequence[str]) -> None:
    for name in names:
        with suppress(UsageError):  # the worker that needs the agent reports the error
            registry.require("agents", name)


def _may_have_cameras(registry: Registry, name: str) -> bool:
    """Return False when the agent's class declares in `consumes` that the agent uses no cameras."""
    try:
        consumes = getattr(registry.entry("agents", name).load(), "consumes", None)
    except UsageError:
        return True
    return not isinstance(consumes, (frozenset, set, tuple, list)) or "cameras" in consumes


def _say(channel: socket.socket, words: dict[str, object]) -> None:
    """Send `words` as JSON to the process that started us."""
    _send(channel, json.dumps(words).encode())


def _send(channel: socket.socket, content: bytes) -> None:
    with suppress(OSError), Connection(os.dup(channel.fileno())) as connection:  # the other process may be gone
        connection.send_bytes(content)


def _warm_up(registry: Registry, setup: WorkerSetup, *, cameras: bool) -> None:
    """Drive two ticks, to load the compiled kernels once for all workers."""
    simulator = registry.simulator(setup.simulator, setup.options)
    rig = (CameraSpec("front", width_px=64, height_px=32),) if cameras else ()
    simulator.reset(resolve_routes("dev10")[0], seed=0, cameras=rig)
    for _ in range(2):
        simulator.observe()
        simulator.truth()
        simulator.step(Control.NEUTRAL)
    simulator.score()
    simulator.close()


def _tell(exit_w: int, number: int) -> None:
    with suppress(OSError):  # the receiver may be gone
        os.write(exit_w, number.to_bytes(4, "little", signed=True))


def _kill(send: Callable[[int, int], None], pid: int) -> None:
    with suppress(OSError):
        send(pid, signal.SIGKILL)
