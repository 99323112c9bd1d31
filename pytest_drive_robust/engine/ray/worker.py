"""What runs on the nodes of a Ray cluster: a supervisor in each of Ray's worker processes.

A fault of the agent ends a process below the supervisor and is data by the time that Ray could see it. So whatever Ray
itself notices is the loss of a node or of its own worker, and worth another attempt.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.messages import refusal_bytes
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.messages import PickledRequest
    from pytest_drive_robust.engine.ray.packages import NodePackages
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["ClusterRequest", "drive_on_node"]

_DEVICES = "CUDA_VISIBLE_DEVICES"


@dataclass(frozen=True, slots=True)
class ClusterRequest:
    """One episode for another process, perhaps on another machine.

    `packages` is None on the machine where the run was started.
    """

    worker_setup: WorkerSetup
    limits: Limits
    request: PickledRequest
    identity: str
    packages: NodePackages | None = None


class _NodeSupervisor:
    """The supervisor of this process, for one setup and one set of devices."""

    def __init__(self, asked: ClusterRequest) -> None:
        packages = asked.packages
        self._setup = asked.worker_setup if packages is None else packages.unpacked(asked.worker_setup)
        before = tuple(sys.path)
        self._registry = self._setup.registry()
        sys.path += [path for path in before if path not in sys.path]  # Ray itself lives there
        self._checked: set[str] = set()
        self._fork_server = ForkServer(self._setup)
        self._supervisor = Supervisor(self._fork_server, asked.limits)

    def drive(self, asked: ClusterRequest) -> bytes:
        episode, route = asked.request.episode, asked.request.route
        if asked.packages is not None and episode.agent not in self._checked:
            asked.packages.check(self._setup, episode.agent)
            self._checked.add(episode.agent)
        request = EpisodeRequest(episode, route, asked.request.read_setting(self._registry), asked.identity)
        return encode_episode(self._supervisor.drive(request))

    def close(self) -> None:
        self._supervisor.close()
        self._fork_server.close()


_supervisors: dict[tuple[WorkerSetup, Limits, str | None], _NodeSupervisor] = {}


def drive_on_node(asked: ClusterRequest) -> tuple[str, bytes]:
    """Return `"record"` with the record, or `"refused"` with a usage error as JSON. A task of Ray's."""
    place = asked.worker_setup, asked.limits, os.environ.get(_DEVICES)
    try:
        if place not in _supervisors:
            while _supervisors:  # Ray gave this process other devices: children that saw the old ones are of no use
                _supervisors.popitem()[1].close()
            _supervisors[place] = _NodeSupervisor(asked)
        return "record", _supervisors[place].drive(asked)
    except UsageError as error:
        return "refused", refusal_bytes(error)
