"""The executor of a cluster: Ray hands episodes to supervisors on its nodes."""

from __future__ import annotations

import importlib.util
import itertools
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.fork_server import Stopped
from pytest_drive_robust.engine.messages import WorkerRequest
from pytest_drive_robust.engine.ray.worker import ClusterRequest
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.cores import available_cores
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.cache_key.code_text import session
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest

_LOCAL = "local"
"""The address of a cluster of our own on this machine, which ends with the run."""
_SAID_BYTES = 2_000
"""How much of the driver's last output is read."""
_SHUTDOWN_S = 15.0
_OBJECT_STORE_BYTES = 100 << 20
_EXCLUDED = (
    ".git", ".drive-robust", ".venv", "venv", ".tox", ".nox", ".mypy_cache", ".pytest_cache", ".ruff_cache",
    ".hypothesis", "__pycache__", "*.py[co]", "*.nb[ci]",
)  # fmt: skip
"""Patterns of files that are not copied with the folder of the run."""


class RayExecutor(Executor):
    """Drives as many episodes at a time as the cluster has room for.

    `address` is `"local"`, `"auto"` (the cluster that this machine belongs to), `"host:port"` or `"ray://host:port"`;
    None means the variable `RAY_ADDRESS`, else our own cluster. `slots` is the largest number of episodes at a time;
    for our own cluster, `slots` is also the number of cores. An agent's class or factory may have the attributes
    `num_cpus` (default 1) and `num_gpus` (default 0): the resources that an episode takes.

    The folder of the run is copied to the nodes of a cluster. Code outside that folder must be installed on the nodes
    in the same version; the process that drives checks that. An episode that is lost with its node is driven again,
    twice at most, and is then an `infra_error`. No process is started, and `worker_setup` is not called, before the
    first episode. A separate process (`ray.driver`) speaks with Ray: when that process ends by itself, the episodes
    under way are lost, and every later episode is refused. Raises `UsageError` when Ray is not installed.
    """

    def __init__(
        self,
        worker_setup: Callable[[], WorkerSetup],
        limits: Limits,
        *,
        address: str | None = None,
        slots: int | None = None,
        registry: Registry | None = None,
    ) -> None:
        if importlib.util.find_spec("ray") is None:
            raise UsageError(
                "--drive-executor ray needs Ray, which is not installed: pip install 'pytest-drive-robust[ray]'. "
                "Without a cluster, --drive-executor processes uses all cores of this machine."
            )
        self._make_setup = worker_setup
        self._limits = limits
        self._address = address or os.environ.get("RAY_ADDRESS") or _LOCAL
        self._most = slots
        self._registry = default_registry() if registry is None else registry
        self._latest: tuple[float, float] = (1.0, 0.0)
        self._nodes: tuple[tuple[float, float], ...] = ()  # (cores, GPUs) of each node
        self._numbers = itertools.count()
        self._pending: dict[int, tuple[ClusterRequest, Future[EpisodeResult]]] = {}
        self._lock = threading.Lock()
        self._closing = False
        self._refused: UsageError | None = None
        self._setup: WorkerSetup | None = None

    @property
    def slots(self) -> int:
        """How many episodes like the latest one fit on the cluster now; 1 before the cluster is connected."""
        cores, gpus = self._latest
        room = sum(int(min(node[0] / cores, node[1] / gpus if gpus else node[0] / cores)) for node in self._nodes)
        return max(1, room if self._most is None else min(room, self._most))

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Hand an episode to the cluster. Raises `UsageError` for a bad `num_cpus` or `num_gpus` of the agent."""
        agent = request.episode.agent
        self._latest = needs_of(self._registry.entry("agents", agent).load(), agent)
        if self._setup is None:
            self._setup = self._make_setup()
            self._start(self._cluster(self._setup.folder))
        asked = ClusterRequest(self._setup, self._limits, WorkerRequest.of(request), self._address != _LOCAL)
        future: Future[EpisodeResult] = Future()
        number = next(self._numbers)  # never reused: the answer of a given-up episode may come late
        with self._lock:
            self._pending[number] = asked, future
        self._write((number, self._latest, asked))
        if self._refused is not None:
            self._give_up()
        return future

    def close(self) -> None:
        """Leave the cluster; episodes under way there are killed."""
        if self._setup is None or self._closing:
            return
        self._closing = True
        self._write(None)
        try:
            self._process.wait(_SHUTDOWN_S)
        except subprocess.TimeoutExpired:
            with suppress(OSError):  # the group, to end Ray's processes, too
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._reader.join()
        self._connection.close()
        self._log.close()

    def _cluster(self, folder: str) -> Mapping[str, object]:
        """Return the arguments of `ray.init`. Ray copies the folder of the run to any cluster but our own."""
        if self._address == _LOCAL:
            own = {"num_cpus": self._most or available_cores(), "object_store_memory": _OBJECT_STORE_BYTES}
            return {"address": _LOCAL, "include_dashboard": False, **own}
        ours = {"PYTEST_XDIST_TESTRUNUID": session()}  # stands in identities for code that cannot be known
        env = {"working_dir": folder, "excludes": list(_EXCLUDED), "env_vars": ours}
        return {"address": self._address, "runtime_env": env}

    def _start(self, cluster: Mapping[str, object]) -> None:
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process that writes it
        path = (str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", ""))  # lets the driver find this package
        path_and_silence = {"PYTHONPATH": os.pathsep.join(filter(None, path)), "RAY_USAGE_STATS_ENABLED": "0"}
        self._connection, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", "from pytest_drive_robust.engine.ray import driver; driver.main()"],
                stdin=theirs.fileno(),
                stdout=self._log,
                stderr=self._log,
                start_new_session=True,  # keeps Ctrl-C away: `close` ends the process
                env={**os.environ, **path_and_silence},
            )
        self._write(cluster)
        self._reader = threading.Thread(target=self._read_all, name="drive-robust-ray", daemon=True)
        self._reader.start()

    def _write(self, message: object) -> None:
        with suppress(OSError):  # the driver ended: `_read_all` answers for it
            self._connection.send(message)

    def _read_all(self) -> None:
        """Read the messages of the driver (see `ray.driver`) until its end; then end every pending episode."""
        with suppress(OSError, EOFError):
            while True:
                number, content = self._connection.recv()
                if number is not None:
                    with self._lock:
                        _, future = self._pending.pop(number)
                    _settle(future, content)
                elif isinstance(content, str):
                    self._refused = _no_cluster(self._address, content)
                else:
                    self._nodes = content
        said = f"the connection to the cluster ended. {self._said()}"
        self._give_up(said)
        self._refused = self._refused or _no_cluster(self._address, said)
        self._give_up()

    def _give_up(self, said: str = "") -> None:
        """End every pending episode: by `Stopped` after `close`, else by the refusal, else as lost, with `said`."""
        with self._lock:
            pending, self._pending = self._pending, {}
        for asked, future in pending.values():
            if self._closing:
                future.set_exception(Stopped())
            else:
                _settle(future, self._refused or asked.lost(said))

    def _said(self) -> str:
        """Return the last 60 words that the driver process printed."""
        self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - _SAID_BYTES))
        return " ".join(self._log.read().decode(errors="replace").split()[-60:])


def _settle(future: Future[EpisodeResult], content: EpisodeResult | UsageError) -> None:
    if isinstance(content, UsageError):
        future.set_exception(content)
    else:
        future.set_result(content)


def _no_cluster(address: str, problem: str) -> UsageError:
    if address == _LOCAL:
        return UsageError(
            f"Ray does not start on this machine: {problem}. Without a cluster, --drive-executor processes uses all "
            "cores of this machine."
        )
    return UsageError(
        f"no Ray cluster can be used at {address!r}: {problem}. Start one with 'ray start --head' and give its "
        "host:port as --drive-ray-address, or give 'local' to use this machine alone. Where 'ray start' says that "
        "token authentication is enabled, set RAY_AUTH_MODE=token here, too; the head's token is in ~/.ray/auth_token."
    )


def needs_of(factory: object, agent: str) -> tuple[float, float]:
    """Return the cores and GPUs that an episode of this agent takes.

    Raises `UsageError` unless `num_cpus` is a number > 0 and `num_gpus` a number >= 0.
    """
    cores, gpus = getattr(factory, "num_cpus", 1), getattr(factory, "num_gpus", 0)
    for name, given, least in (("num_cpus", cores, "> 0"), ("num_gpus", gpus, ">= 0")):
        is_number = isinstance(given, (int, float)) and not isinstance(given, bool) and math.isfinite(given)
        if not is_number or given < 0 or (given == 0 and least == "> 0"):
            raise UsageError(f"the agent {agent!r} has {name} = {given!r}, expected a number {least}.")
    return float(cores), float(gpus)
