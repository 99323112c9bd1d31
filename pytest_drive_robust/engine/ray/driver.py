"""The process between pytest and a Ray cluster: the only one of ours that imports Ray next to Ray's own workers.

Ray replaces signal handlers, writes to the terminal and ends the process that uses it when its cluster is lost. None of
that may happen to pytest, so it happens here. The two exchange messages over a connection, this process's standard
input; when it ends, however that came about, every running episode is cancelled and a cluster of our own is taken down.
"""

from __future__ import annotations

import json
import logging
import os
import queue
import signal
import socket
import struct
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any
from urllib.parse import urlsplit

from pytest_drive_robust.engine.messages import TOKEN_BYTES, Message, receive, refusal_bytes, send
from pytest_drive_robust.engine.ray.worker import RECORD, UNUSABLE, drive_on_node
from pytest_drive_robust.errors import UsageError

__all__ = ["CLUSTER", "DRIVE", "LOST", "NEEDS", "OPEN", "RECORD", "REFUSED", "UNUSABLE", "main"]

OPEN, DRIVE = b"o", b"d"
"""To the driver: which cluster (JSON), and an episode (`NEEDS`, a pickled `ClusterRequest`; the token numbers it)."""
CLUSTER, REFUSED, LOST = b"c", b"x", b"l"
"""From the driver: the nodes (JSON), why there is no cluster, why an episode has no result. Or a worker's reply."""
NEEDS = struct.Struct("<dd")
"""Cores and GPUs of an episode."""

_NO_EPISODE = bytes(TOKEN_BYTES)
_POLL_S = 1.0
_CONNECT_S = 10.0
_PATIENCE_S = 60.0
_LOST_NODES = 2
_SHUTDOWN_S = 10.0
_LAST_MESSAGES_S = 1.0
_OBJECT_STORE_BYTES = 100 << 20
_MOST_TEXT = 600
_INSTALL = "Install the same versions of pytest-drive-robust and of what the agent needs on every node."


class _Cluster:
    """A connection to Ray and the episodes that are under way there."""

    def __init__(self, ray: Any, reply: Any) -> None:
        self._ray = ray
        self._reply = reply
        self._drive = ray.remote(drive_on_node)
        self._running: dict[bytes, tuple[Any, tuple[float, float]]] = {}
        self._nodes: list[list[float]] = []
        self._hopeless_since_s: dict[bytes, float] = {}

    def update(self) -> None:
        """Tell about nodes that came or went; give up what no node can drive any more."""
        alive = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
        nodes = [[node.get("CPU", 0.0), node.get("GPU", 0.0)] for node in alive]
        if nodes != self._nodes:
            self._nodes = nodes
            self._reply(Message(CLUSTER, _NO_EPISODE, json.dumps(nodes).encode()))
        for number, (ref, needs) in tuple(self._running.items()):
            if self._fits(needs):
                self._hopeless_since_s.pop(number, None)
            elif time.monotonic() - self._hopeless_since_s.setdefault(number, time.monotonic()) > _PATIENCE_S:
                self._end(number, LOST, f"no node of the cluster has {_in_words(needs)} any more")
                self._ray.cancel(ref, force=True)

    def begin(self, number: bytes, needs: tuple[float, float], cluster_request: bytes) -> None:
        """Hand an episode to Ray."""
        if not self._fits(needs):
            nodes = "; ".join(_in_words((cores, gpus)) for cores, gpus in self._nodes) or "no node at all"
            text = f"an episode of this agent takes {_in_words(needs)}, and no node of the cluster has that: {nodes}."
            self._reply(Message(UNUSABLE, number, refusal_bytes(UsageError(text))))
            return
        cores, gpus = needs
        ref = self._drive.options(num_cpus=cores, num_gpus=gpus, max_retries=_LOST_NODES).remote(cluster_request)
        self._running[number] = ref, needs
        ref.future().add_done_callback(partial(self._done, number))

    def cancel(self) -> None:
        """Kill what is under way."""
        running, self._running = self._running, {}
        for ref, _ in running.values():
            self._ray.cancel(ref, force=True)

    def _done(self, number: bytes, future: Any) -> None:
        error = future.exception()
        if error is None:
            content: bytes = future.result()
            self._end(number, content[:1], content[1:])
        elif _is_setup(error):
            text = f"the nodes of the cluster cannot run our code: {_last_line(error)}. {_INSTALL}"
            self._end(number, UNUSABLE, refusal_bytes(UsageError(text)))
        else:
            self._end(number, LOST, f"{type(error).__name__}: {_brief(error)}")
        if type(error).__name__ == "LocalRayletDiedError":  # the node that we are on: nothing works from here on
            _kill_own_group(_LAST_MESSAGES_S)

    def _end(self, number: bytes, kind: bytes, content: bytes | str) -> None:
        if self._running.pop(number, None) is not None:  # otherwise it was cancelled or given up
            self._reply(Message(kind, number, content.encode() if isinstance(content, str) else content))

    def _fits(self, needs: tuple[float, float]) -> bool:
        return any(cores >= needs[0] and gpus >= needs[1] for cores, gpus in self._nodes)


def main() -> None:
    """Serve one controller until it closes the connection."""
    connection = Connection(os.dup(0))
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)  # nobody below us keeps the connection open
    inbox: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
    threading.Thread(target=_read_all, args=(connection, inbox), daemon=True).start()
    writing = threading.Lock()

    def reply(message: Message) -> None:
        with writing:
            try:
                send(connection, message)
            except OSError:  # nobody listens: our input ends in this moment, too
                inbox.put(None)

    opening = inbox.get()
    if opening is None:
        return
    try:
        cluster = _opened(json.loads(opening.payload), reply)
    except (Exception, SystemExit) as error:
        reply(Message(REFUSED, _NO_EPISODE, _brief(error).encode()))
        return
    try:
        _serve(cluster, inbox)
    finally:
        _kill_own_group(_SHUTDOWN_S)
        cluster.cancel()
        sys.modules["ray"].shutdown()


def _kill_own_group(after_s: float) -> None:
    """Kill our own process group after a while: Ray waits a minute for a cluster that is gone."""
    timer = threading.Timer(after_s, os.killpg, (os.getpgrp(), signal.SIGKILL))
    timer.daemon = True
    timer.start()


def _serve(cluster: _Cluster, inbox: queue.SimpleQueue[Message | None]) -> None:
    while True:
        try:
            message = inbox.get(timeout=_POLL_S)
        except queue.Empty:
            cluster.update()
            continue
        if message is None:
            return
        cluster.begin(message.token, NEEDS.unpack_from(message.payload), message.payload[NEEDS.size :])


def _opened(wanted: dict[str, Any], reply: Any) -> _Cluster:
    address = wanted["address"]
    _require_listener(address)
    os.environ.update(RAY_USAGE_STATS_ENABLED="0")
    os.environ.setdefault("RAY_task_oom_retries", str(_LOST_NODES))  # without it an episode is tried for ever
    import ray

    own = {"num_cpus": wanted["cores"], "include_dashboard": False, "object_store_memory": _OBJECT_STORE_BYTES}
    ray.init(
        address=address,
        log_to_driver=False,
        logging_level=logging.ERROR,
        **(own if address == "local" else {"runtime_env": wanted["runtime_env"]}),
    )
    cluster = _Cluster(ray, reply)
    cluster.update()
    return cluster


def _require_listener(address: str) -> None:
    """Raise `OSError` when nobody listens at `host:port`: Ray itself would try for minutes."""
    parts = urlsplit(address if "://" in address else f"//{address}")
    if parts.hostname and parts.port:
        socket.create_connection((parts.hostname, parts.port), timeout=_CONNECT_S).close()


def _read_all(connection: Connection, inbox: queue.SimpleQueue[Message | None]) -> None:
    with suppress(OSError, EOFError, ValueError):
        while True:
            inbox.put(receive(connection))
    inbox.put(None)


def _is_setup(error: BaseException) -> bool:
    """Tell whether the request could not even begin, on any node."""
    unable = isinstance(getattr(error, "cause", None), ImportError) or "failed to import" in str(error)
    return unable or type(error).__name__ == "RuntimeEnvSetupError"


def _brief(error: BaseException) -> str:
    """Return what an error of Ray says, without its tracebacks and advice about log files."""
    cause = getattr(error, "cause", None)
    text = str(cause if isinstance(cause, BaseException) else error).strip() or type(error).__name__
    return " ".join(text.split())[:_MOST_TEXT].rstrip(".")


def _last_line(error: BaseException) -> str:
    """Return the line in which a text with tracebacks says what happened."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1][:_MOST_TEXT].rstrip(".") if lines else type(error).__name__


def _in_words(needs: tuple[float, float]) -> str:
    cores, gpus = needs
    return f"num_cpus={cores:g}" + (f", num_gpus={gpus:g}" if gpus else "")
