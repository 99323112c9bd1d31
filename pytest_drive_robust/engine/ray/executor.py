"""The executor of a cluster: Ray hands episodes to supervisors on its nodes."""

from __future__ import annotations

import importlib.util
import math
import os
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.contents import contents_of
from pytest_drive_robust.engine.messages import WorkerRequest
from pytest_drive_robust.engine.ray.connection import LOCAL, ClusterConnection
from pytest_drive_robust.engine.ray.worker import ClusterRequest
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.execution import available_cores
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.cache_key.object_code import SESSION

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["RayExecutor", "needs_of"]

_OBJECT_STORE_BYTES = 100 << 20
_EXCLUDED = (
    ".git",
    ".drive-robust",
    ".venv",
    "venv",
    ".tox",
    ".nox",
    ".mypy_cache",
    ".pytest_cache",
    ".ruff_cache",
    ".hypothesis",
    "__pycache__",
    "*.py[co]",
    "*.nb[ci]",
)
"""What is not copied with the folder of the run."""


class RayExecutor:
    """Drives as many episodes at a time as the cluster has room for (see `runner.executors.Executor`).

    `address` is `"local"`, `"auto"` (the cluster that this machine belongs to), `"host:port"` or `"ray://host:port"`;
    None means the variable `RAY_ADDRESS`, or a cluster of our own. `slots` bounds the number of episodes; for a cluster
    of our own it is the number of cores. The classes or functions that make agents may say what an episode takes, as
    attributes `num_cpus` (1 when they do not) and `num_gpus` (0).

    The folder of the run is copied to the nodes of a cluster. What lies elsewhere must be installed there in the same
    version; the process that drives checks that (`engine.contents`), because a result must not be stored under the name
    of code that did not drive it.

    An episode that was lost with its node is driven again, twice at most, and is an `infra_error` after that. Nothing
    is started, and `worker_setup` not called, before the first episode. Raises `UsageError` when Ray is not installed.
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
        _require_ray()
        self._make_setup = worker_setup
        self._setup: WorkerSetup | None = None
        self._limits = limits
        self._address = address or os.environ.get("RAY_ADDRESS") or LOCAL
        self._most = slots
        self._registry = default_registry() if registry is None else registry
        self._needs: dict[str, tuple[float, float]] = {}
        self._latest: tuple[float, float] = (1.0, 0.0)
        self._link: ClusterConnection | None = None
        self._closed = False

    @property
    def slots(self) -> int:
        """How many episodes like the last one fit on the cluster at this moment; before it is there, one."""
        nodes = self._link.nodes if self._link is not None else ()
        cores, gpus = self._latest
        room = sum(int(min(node[0] / cores, node[1] / gpus if gpus else node[0] / cores)) for node in nodes)
        return max(1, room if self._most is None else min(room, self._most))

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Hand an episode to the cluster. Raises `UsageError` for an agent that asks for no number of cores."""
        agent = request.episode.agent
        setup = self._setup
        if setup is None or agent not in self._needs:
            setup = self._setup = self._setup_for(agent, setup or self._make_setup())
        self._latest = self._needs[agent]
        if self._link is not None and self._link.is_lost:
            self._link.close(cancel=True)
            self._link = None
        if self._link is None:
            self._link = self._connected(setup.folder)
        asked = ClusterRequest(setup, self._limits, WorkerRequest.of(request), self._address != LOCAL)
        return self._link.send(asked, self._latest)

    def close(self, *, cancel: bool = False) -> None:
        """Leave the cluster. With `cancel`, what is under way there is killed; without, it comes to its end first."""
        if self._closed:
            return
        self._closed = True
        if self._link is not None:
            self._link.close(cancel=cancel)

    def _setup_for(self, agent: str, setup: WorkerSetup) -> WorkerSetup:
        """Note what an episode of a new agent takes; return a setup by which no node drives another version of it."""
        factory = self._registry.entry("agents", agent).load()
        needs = needs_of(factory, agent)
        if self._address != LOCAL:
            world = self._registry.simulator(setup.simulator, setup.options)
            try:
                contents = contents_of(self._registry, agent, worker_setup=setup, world=world)
            finally:
                world.close()
            setup = replace(setup, contents=(*setup.contents, (agent, contents)))
        self._needs[agent] = needs
        return setup

    def _connected(self, folder: str) -> ClusterConnection:
        """Return a new connection. To another cluster the folder of the run is copied, and what it finds is checked."""
        if self._address == LOCAL:
            own = {"num_cpus": self._most or available_cores(), "object_store_memory": _OBJECT_STORE_BYTES}
            return ClusterConnection({"address": LOCAL, "include_dashboard": False, **own})
        session = {"PYTEST_XDIST_TESTRUNUID": SESSION}  # stands in the contents of agents for code that cannot be known
        env = {"working_dir": folder, "excludes": list(_EXCLUDED), "env_vars": session}
        return ClusterConnection({"address": self._address, "runtime_env": env})


def needs_of(factory: object, agent: str) -> tuple[float, float]:
    """Return the cores and GPUs that an episode of this agent takes. Raises `UsageError` for what is no such number."""
    cores, gpus = getattr(factory, "num_cpus", 1), getattr(factory, "num_gpus", 0)
    for name, given, least in (("num_cpus", cores, "> 0"), ("num_gpus", gpus, ">= 0")):
        is_number = isinstance(given, (int, float)) and not isinstance(given, bool) and math.isfinite(given)
        if not is_number or given < 0 or (given == 0 and least == "> 0"):
            raise UsageError(f"the agent {agent!r} has {name} = {given!r}, expected a number {least}.")
    return float(cores), float(gpus)


def _require_ray() -> None:
    if importlib.util.find_spec("ray") is None:
        raise UsageError(
            "--drive-executor ray needs Ray, which is not installed: pip install 'pytest-drive-robust[ray]'. "
            "Without a cluster, --drive-executor processes uses all cores of this machine."
        )
