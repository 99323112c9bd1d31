"""The fork_server's own process: it knows everything that driving takes, drives nothing, and forks children that do.

It has one thread and its own session, so that forking is safe and no Ctrl-C reaches it. It ends with the process that
started it, and takes every child with it.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import pickle
import selectors
import signal
import socket
import struct
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from pytest_drive_robust.engine.cradle import Knock, surroundings_of
from pytest_drive_robust.engine.worker.serve import Descriptors, serve
from pytest_drive_robust.engine.worker.system import adopt_orphans, die_with_parent, no_core_files
from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["LARGEST_MESSAGE_BYTES", "cradle", "main", "spawned"]

LARGEST_MESSAGE_BYTES = 1 << 17
_STATUS = struct.Struct("<i")
_LOOK_S = 0.5


def main(control: int) -> NoReturn:
    """Serve the socket with this descriptor until its other end is closed."""
    with socket.socket(fileno=control) as channel:
        _attend(channel, pickle.loads(channel.recv(LARGEST_MESSAGE_BYTES)))
    os._exit(0)


def cradle(door: int, lifeline: int) -> NoReturn:
    """Load the world of the setup at standard input, then fork a server for everyone who knocks at the socket.

    Ends when the other end of the pipe `lifeline` is closed, or when threads were started that forbid forking.
    """
    worker_setup: WorkerSetup = pickle.load(sys.stdin.buffer)
    surroundings = surroundings_of(worker_setup)
    _prepared(worker_setup)
    gc.collect()
    gc.freeze()
    with socket.socket(fileno=door) as listener, selectors.DefaultSelector() as selector:
        selector.register(listener, selectors.EVENT_READ)
        selector.register(lifeline, selectors.EVENT_READ)
        while _threads() <= worker_setup.threads:
            ready = {key.fd for key, _ in selector.select(_LOOK_S)}
            if lifeline in ready:
                break
            if door in ready:
                _adopt(listener, lifeline, surroundings)
            with contextlib.suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
    os._exit(0)


def _adopt(listener: socket.socket, lifeline: int, surroundings: str) -> None:
    """Fork a fork_server for whoever knocks. It has a session of its own, as if it had been started afresh."""
    with listener.accept()[0] as channel:
        if os.fork():
            return
        try:
            os.setsid()
            listener.close()
            os.close(lifeline)
            data, fds, _, _ = socket.recv_fds(channel, LARGEST_MESSAGE_BYTES, 1)
            asked = Knock._make(pickle.loads(data))
            if asked.surroundings == surroundings:
                channel.send(json.dumps({"pid": os.getpid()}).encode())
                for number in (1, 2):
                    os.dup2(fds[0], number)
                os.close(fds[0])
                os.environ.clear()
                os.environ.update(asked.environment)
                _forget_registry()
                _attend(channel, asked.worker_setup)
        finally:
            os._exit(0)


def _forget_registry() -> None:
    """The next one is made for another `sys.path`."""
    from pytest_drive_robust.registry.registry import default_registry

    default_registry.cache_clear()
    importlib.invalidate_caches()


def _attend(channel: socket.socket, worker_setup: WorkerSetup) -> None:
    """Get ready, say so, and fork children until the other end of the channel is closed."""
    started = time.perf_counter()
    try:
        registry = _prepared(worker_setup)
    except UsageError as error:
        channel.send(json.dumps({"type": type(error).__name__, "text": str(error)}).encode())
        return
    no_core_files()
    adopt_orphans()
    gc.collect()
    gc.freeze()  # what is shared with the children is not touched by their collectors
    ready = {"threads": _threads(), "seconds": time.perf_counter() - started}
    channel.send(json.dumps(ready).encode())
    _ForkServer(channel, worker_setup, registry).run()


def spawned(messages: int, output: int, faults: int, board: int) -> NoReturn:
    """A child that was not forked: the worker_setup and the limits come as the first message."""
    from pytest_drive_robust.engine.frames import read_frame

    first = read_frame(messages)
    if first is None:
        os._exit(0)
    worker_setup, limits = pickle.loads(first.payload)
    no_core_files()
    adopt_orphans()
    _leave_with(messages)
    registry = worker_setup.registry()
    worker_setup.limit_threads()
    serve(Descriptors(messages, output, faults, board), worker_setup, limits, registry)
    os._exit(0)


class _ForkServer:
    """Forks on request, and tells of each child when it began and how it ended."""

    def __init__(self, channel: socket.socket, worker_setup: WorkerSetup, registry: Registry) -> None:
        self._channel = channel
        self._setup = worker_setup
        self._registry = registry
        self._reports: dict[int, int] = {}  # by child: where its end is told
        self._parent = os.getppid()
        self._pid = os.getpid()

    def run(self) -> None:
        """Until nobody wants children any more."""
        wake_r, wake_w = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(wake_w, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        with selectors.DefaultSelector() as selector:
            selector.register(self._channel, selectors.EVENT_READ)
            selector.register(wake_r, selectors.EVENT_READ)
            while os.getppid() == self._parent:
                ready = {key.fd for key, _ in selector.select(_LOOK_S)}
                if wake_r in ready:
                    os.read(wake_r, 1024)
                self._bury()
                if self._channel.fileno() in ready and not self._serve((wake_r, wake_w, selector)):
                    break
        self._end()

    def _serve(self, own: tuple[int, int, selectors.BaseSelector]) -> bool:
        """One request. False when there will be no more."""
        data, fds, _, _ = socket.recv_fds(self._channel, LARGEST_MESSAGE_BYTES, 5)
        if not data:
            return False
        limits: Limits = pickle.loads(data)
        report, channels = fds[0], Descriptors(*fds[1:])
        pid = os.fork()
        if pid == 0:
            self._be_child(own, report, channels, limits)
        for number in channels:
            os.close(number)
        self._reports[pid] = report
        _tell(report, pid)
        return True

    def _be_child(
        self,
        own: tuple[int, int, selectors.BaseSelector],
        report: int,
        channels: Descriptors,
        limits: Limits,
    ) -> NoReturn:
        try:
            os.setsid()
            die_with_parent(self._pid)
            adopt_orphans()
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            own[2].close()
            self._channel.close()
            for number in (*own[:2], report, *self._reports.values()):
                os.close(number)
            serve(channels, self._setup, limits, self._registry)
        except BaseException:
            import traceback

            traceback.print_exc()
            os._exit(70)
        os._exit(0)

    def _bury(self) -> None:
        """Tell of those that ended, and kill what they left."""
        while True:
            try:
                found = os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            except ChildProcessError:
                return
            if found is None:
                return
            pid: int = found.si_pid
            if pid in self._reports:
                _kill_group(pid)  # its number is not free before we wait for it
            _, status = os.waitpid(pid, 0)
            report = self._reports.pop(pid, None)
            if report is not None:
                _tell(report, status)
                os.close(report)
                self._kill_orphans()

    def _kill_orphans(self) -> None:
        """What a child started outside its group belongs to us when the child is dead."""
        for pid in _children():
            if pid not in self._reports:
                _kill(pid)

    def _end(self) -> None:
        for pid in self._reports:
            _kill_group(pid)
        deadline = time.monotonic() + 2.0
        while _children() and time.monotonic() < deadline:
            self._bury()
            self._kill_orphans()
            time.sleep(0.005)


def _prepared(worker_setup: WorkerSetup) -> Registry:
    registry = worker_setup.registry()
    registry.require("simulators", worker_setup.simulator)
    if worker_setup.simulator == "embedded":
        _warm_up(registry, worker_setup)
    for name in worker_setup.preload_agents:
        with contextlib.suppress(UsageError):  # the child that needs it says so
            registry.require("agents", name)
    worker_setup.limit_threads()
    return registry


def _warm_up(registry: Registry, worker_setup: WorkerSetup) -> None:
    """Load the compiled kernels once for all children."""
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import CameraSpec
    from pytest_drive_robust.runner.routes import resolve_routes

    simulator = registry.simulator(worker_setup.simulator, worker_setup.options)
    simulator.reset(resolve_routes("dev10")[0], seed=0, cameras=(CameraSpec("front", width_px=64, height_px=32),))
    for _ in range(2):
        simulator.observe()
        simulator.truth()
        simulator.step(Control.NEUTRAL)
    simulator.score()
    simulator.close()


def _leave_with(messages: int) -> None:
    """End when the channel is closed, whatever the agent does. A raw thread: no list of threads shows it."""
    import _thread

    def watch(parent: int) -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_S)
        os._exit(0)

    _thread.start_new_thread(watch, (os.getppid(),))


def _tell(report: int, number: int) -> None:
    try:
        os.write(report, _STATUS.pack(number))
    except OSError:  # nobody waits for it any more
        return


def _kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except OSError:
        return


def _kill_group(pid: int) -> None:
    try:
        os.killpg(pid, signal.SIGKILL)
    except OSError:
        return


def _children() -> list[int]:
    try:
        return [int(pid) for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()]
    except OSError:
        return []


def _threads() -> int:
    try:
        return len(os.listdir("/proc/self/task"))
    except OSError:
        return 1


if __name__ == "__main__":
    main(int(sys.argv[1]))
