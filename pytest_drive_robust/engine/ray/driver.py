"""The process between pytest and a Ray cluster: beside Ray's own workers, only this process of ours imports Ray.

Ray replaces signal handlers, writes to the terminal, and ends its process when the cluster is lost; pytest must be safe
from that. When this process ends, every running episode is cancelled, and a cluster of our own is shut down.

The process reads messages from its standard input: the arguments of `ray.init`, then `(number, needs, ClusterRequest)`
for each episode, and None at the end. The process writes `(number, result of drive_on_node)` for each episode, and
`(None, content)`, where content is the cores and GPUs of each node, or the reason why there is no cluster. All messages
are pickled: no agent runs in the processes that write them.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any
from urllib.parse import urlsplit

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.ray.worker import ClusterRequest, drive_on_node
from pytest_drive_robust.errors import UsageError

_POLL_S = 1.0
_CONNECT_S = 10.0
_LOST_NODES = 2
_HEAD_S = "15"
"""Seconds without the head of the cluster after which Ray ends its client, as text. Ray's default is 60."""
_SHUTDOWN_S = 10.0
_LAST_MESSAGES_S = 1.0
_MOST_TEXT = 600
_INSTALL = "Install the same versions of pytest-drive-robust and of what the agent needs on every node."


class _Driver:
    """A connection to Ray and the episodes that are under way there."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._saying = threading.Lock()
        self._ray: Any = None
        self._drive: Any = None
        self._running: dict[int, tuple[Any, tuple[float, float], ClusterRequest]] = {}
        self._nodes: tuple[tuple[float, float], ...] = ()

    def connect(self) -> bool:
        """Connect to the cluster that the first message names; send its nodes, or the reason why that failed.

        Returns False when there is no cluster to use.
        """
        cluster = self._hear()
        if cluster is None:
            return False
        try:
            _require_listener(cluster["address"])
            os.environ.setdefault("RAY_gcs_rpc_server_reconnect_timeout_s", _HEAD_S)
            os.environ.setdefault("RAY_task_oom_retries", str(_LOST_NODES))  # Ray's default retries for ever
            import ray

            ray.init(log_to_driver=False, logging_level=logging.ERROR, **cluster)
            self._ray, self._drive = ray, ray.remote(drive_on_node)
            self._update()
        except (Exception, SystemExit) as error:
            self._say(None, _brief(error))
            return False
        return True

    def serve(self) -> None:
        """Hand episodes to Ray until the executor sends None or is gone."""
        while True:
            if not self._connection.poll(_POLL_S):
                self._update()
                continue
            asked = self._hear()
            if asked is None:
                return
            self._begin(*asked)

    def close(self) -> None:
        """Cancel the running episodes and leave the cluster."""
        running, self._running = self._running, {}
        for ref, *_ in running.values():
            self._ray.cancel(ref, force=True)
        self._ray.shutdown()

    def _update(self) -> None:
        """Send the nodes when some came or went; give up episodes that no node can drive any more."""
        alive = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
        nodes = tuple((node.get("CPU", 0.0), node.get("GPU", 0.0)) for node in alive)
        if nodes != self._nodes:
            self._nodes = nodes
            self._say(None, nodes)
        for number, (ref, needs, asked) in tuple(self._running.items()):
            if not self._fits(needs):
                self._end(number, ref, asked.lost(f"no node of the cluster has {_in_words(needs)} any more"))
                self._ray.cancel(ref, force=True)

    def _begin(self, number: int, needs: tuple[float, float], asked: ClusterRequest) -> None:
        if not self._fits(needs):
            nodes = "; ".join(map(_in_words, self._nodes)) or "no node at all"
            text = f"an episode of this agent takes {_in_words(needs)}, and no node of the cluster has that: {nodes}."
            self._say(number, UsageError(text))
            return
        cores, gpus = needs
        ref = self._drive.options(num_cpus=cores, num_gpus=gpus, max_retries=_LOST_NODES).remote(asked)
        self._running[number] = ref, needs, asked
        ref.future().add_done_callback(partial(self._done, number, ref, asked))

    def _done(self, number: int, ref: Any, asked: ClusterRequest, future: Any) -> None:
        error = future.exception()
        if error is None:
            self._end(number, ref, future.result())
        elif _is_setup(error):
            last_line = str(error).strip().splitlines()[-1].strip()  # after a traceback
            self._end(number, ref, UsageError(f"the nodes of the cluster cannot run our code: {last_line} {_INSTALL}"))
        else:
            self._end(number, ref, asked.lost(f"{type(error).__name__}: {_brief(error)}"))
        if type(error).__name__ == "LocalRayletDiedError":  # our own node is lost: nothing works from now on
            _kill_own_group(_LAST_MESSAGES_S)

    def _end(self, number: int, ref: Any, result: EpisodeResult | UsageError) -> None:
        ours = self._running.get(number, (None,))[0] is ref  # otherwise it was cancelled or given up
        if ours and self._running.pop(number, None) is not None:
            self._say(number, result)

    def _hear(self) -> Any:
        try:
            return self._connection.recv()
        except (EOFError, OSError):
            return None

    def _say(self, number: int | None, content: object) -> None:
        with self._saying, suppress(OSError):  # the executor is gone: our input ends, too
            self._connection.send((number, content))

    def _fits(self, needs: tuple[float, float]) -> bool:
        return any(cores >= needs[0] and gpus >= needs[1] for cores, gpus in self._nodes)


def main() -> None:
    """Serve the process that started this one."""
    connection = Connection(os.dup(0))
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)  # so that no sub-process keeps the connection open
    driver = _Driver(connection)
    if not driver.connect():
        return
    try:
        driver.serve()
    finally:
        _kill_own_group(_SHUTDOWN_S)
        driver.close()


def _kill_own_group(after_s: float) -> None:
    """Kill our own process group after `after_s` seconds: Ray waits a minute for a lost cluster."""
    timer = threading.Timer(after_s, os.killpg, (os.getpgrp(), signal.SIGKILL))
    timer.daemon = True
    timer.start()


def _require_listener(address: str) -> None:
    """Raise `OSError` when nobody listens at `host:port`: Ray itself would try for minutes."""
    parts = urlsplit(address if "://" in address else f"//{address}")
    if parts.hostname and parts.port:
        socket.create_connection((parts.hostname, parts.port), timeout=_CONNECT_S).close()


def _is_setup(error: BaseException) -> bool:
    """Return whether no node can run our code: an import or the runtime environment failed."""
    unable = isinstance(getattr(error, "cause", None), ImportError) or "failed to import" in str(error)
    return unable or type(error).__name__ == "RuntimeEnvSetupError"


def _brief(error: BaseException) -> str:
    """Return the text of a Ray error, without tracebacks and advice about log files."""
    cause = getattr(error, "cause", None)
    text = str(cause if isinstance(cause, BaseException) else error).strip() or type(error).__name__
    return " ".join(text.split())[:_MOST_TEXT].rstrip(".")


def _in_words(needs: tuple[float, float]) -> str:
    cores, gpus = needs
    return f"num_cpus={cores:g}" + (f", num_gpus={gpus:g}" if gpus else "")
