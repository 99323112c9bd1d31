"""In the fork server's process: load everything that driving takes, drive nothing, and fork workers that do.

It has one thread and its own session, so that forking is safe and no Ctrl-C reaches it. It ends with the process that
started it, and takes every worker with it.
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
"""How often to look for workers that ended."""
_ENDING_S = 2.0


def serve_forks(control: int, parent: int) -> NoReturn:
    """Serve the socket `control` until its other end or the process `parent` is gone. The setup is at stdin."""
    setup: WorkerSetup = pickle.load(sys.stdin.buffer)
    if sys.platform == "linux":  # elsewhere it takes a thread
        die_with_parent(parent)  # what is imported may take long, or hang
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
    """Serve as a worker that was not forked, by descriptors, of a parent. Stdin has the `WorkerSetup` and `Limits`."""
    setup, limits = pickle.load(sys.stdin.buffer)
    *inherited, parent = numbers
    _be_worker_of(parent)
    registry = setup.registry()
    setup.limit_threads()
    serve(inherited, setup, limits, registry)
    os._exit(0)


class _Server:
    """Starts workers on request, and tells of each when it began and how it ended."""

    def __init__(
        self, control: socket.socket, worker_setup: WorkerSetup, registry: Registry, compilation: Compilation | None
    ) -> None:
        self._control = control
        self._setup = worker_setup
        self._registry = registry
        self._compilation = compilation
        self._exits: dict[int, int] = {}  # by worker: where its end is told
        self._pid = os.getpid()

    def run(self, parent: int) -> None:
        """Run until nobody wants workers any more."""
        self._tell_ready()
        while os.getppid() == parent:
            ready = wait([self._control, *self._news()], _POLL_S)
            self._reap()
            if any(number in ready for number in self._news()):
                self._hear_compilers()
            if self._control in ready and not self._start_worker():
                break
        self._end()

    def _news(self) -> tuple[int, ...]:
        """Return the descriptor where processes that compile are heard, while there are any."""
        news = None if self._compilation is None else self._compilation.news
        return () if news is None else (news,)

    def _hear_compilers(self) -> None:
        """Hear how far the processes have come that compile; when all is there, load it for the workers to come."""
        assert self._compilation is not None
        self._compilation.hear()
        if self._compilation.news is None:
            self._compilation = None
            _warm_up(self._registry, self._setup, cameras=True)
            self._setup.limit_threads()
            self._tell_ready()

    def _tell_ready(self) -> None:
        """Say whether workers are forked, and which agents can be driven; None for all of them."""
        gc.collect()
        gc.freeze()  # what is shared with the workers is not touched by their collectors
        self._forks = sys.platform == "linux" and len(os.listdir("/proc/self/task")) <= self._setup.threads
        drives = None if self._compilation is None else self._setup.preload_agents[:1]
        _say(self._control, {"forks": self._forks, "drives": drives})

    def _start_worker(self) -> bool:
        """Answer one request; False when there will be no more."""
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
            process.returncode = 0  # its end is ours to notice, not that of the next `Popen`
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
            for number in (exit_w, *self._exits.values(), *self._news()):  # it must not tell of an end itself
                os.close(number)
            serve(inherited, self._setup, limits, self._registry)
        except BaseException:
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
        compilers = () if self._compilation is None else self._compilation.children
        for pid in child_processes():
            if pid not in self._exits and pid not in compilers:
                _kill(os.kill, pid)

    def _end(self) -> None:
        self._compilation = None  # what still compiles is ended
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
    signal.signal(signal.SIGINT, signal.default_int_handler)  # pytest may have been started to ignore it


def _loaded(setup: WorkerSetup, tell: Callable[[int, int], None]) -> tuple[Registry, Compilation | None]:
    """Import everything and compile what the first agent of the setup needs; return what is compiled meanwhile, too.

    `tell(done, total)` hears of functions being compiled that somebody waits for.
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
    return registry, compilation if compilation is not None and compilation.news is not None else None


def _import_agents(registry: Registry, names: Sequence[str]) -> None:
    for name in names:
        with suppress(UsageError):  # the worker that needs it says so
            registry.require("agents", name)


def _may_have_cameras(registry: Registry, name: str) -> bool:
    """Return False where the agent's class says that no camera reaches it."""
    try:
        consumes = getattr(registry.entry("agents", name).load(), "consumes", None)
    except UsageError:
        return True
    return not isinstance(consumes, (frozenset, set, tuple, list)) or "cameras" in consumes


def _say(channel: socket.socket, words: dict[str, object]) -> None:
    """Tell the process that started us something."""
    _send(channel, json.dumps(words).encode())


def _send(channel: socket.socket, content: bytes) -> None:
    with suppress(OSError), Connection(os.dup(channel.fileno())) as connection:  # nobody may listen any more
        connection.send_bytes(content)


def _warm_up(registry: Registry, setup: WorkerSetup, *, cameras: bool) -> None:
    """Load the compiled kernels once for all workers."""
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
    with suppress(OSError):  # nobody waits for it any more
        os.write(exit_w, number.to_bytes(4, "little", signed=True))


def _kill(send: Callable[[int, int], None], pid: int) -> None:
    with suppress(OSError):
        send(pid, signal.SIGKILL)
