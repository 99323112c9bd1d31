"""What runs on the nodes of a Ray cluster: a supervisor in each of Ray's worker processes.

A fault of the agent ends a process below the supervisor and is data by the time that Ray could see it. So whatever Ray
itself notices is the loss of a node or of its own worker, and worth another attempt.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.pickled_request import PickledRequest
    from pytest_drive_robust.engine.ray.packages import NodePackages
    from pytest_drive_robust.engine.worker_setup import WorkerSetup

__all__ = ["RECORD", "UNUSABLE", "ClusterRequest", "drive_on_node", "refused"]

RECORD, UNUSABLE = b"r", b"u"
"""The first byte of a reply: a record of the store follows, or a usage error as JSON."""
_DEVICES = "CUDA_VISIBLE_DEVICES"


@dataclass(frozen=True, slots=True)
class ClusterRequest:
    """One episode for another process, perhaps on another machine.

    `packages` is None on the machine where the run was started.
    """

    worker_setup: WorkerSetup
    limits: Limits
    order: PickledRequest
    identity: str
    packages: NodePackages | None = None


class _Post:
    """The supervisor of this process, for one worker_setup and one set of devices."""

    def __init__(self, cluster_request: ClusterRequest) -> None:
        packages = cluster_request.packages
        self._setup = (
            cluster_request.worker_setup if packages is None else packages.unpacked(cluster_request.worker_setup)
        )
        before = tuple(sys.path)
        self._registry = self._setup.registry()
        sys.path += [path for path in before if path not in sys.path]  # Ray itself lives there
        self._checked: set[str] = set()
        self._fork_server = ForkServer(self._setup)
        self._supervisor = Supervisor(self._fork_server, cluster_request.limits)

    def drive(self, cluster_request: ClusterRequest) -> bytes:
        episode, route = cluster_request.order.episode, cluster_request.order.route
        if cluster_request.packages is not None and episode.agent not in self._checked:
            cluster_request.packages.check(self._setup, episode.agent)
            self._checked.add(episode.agent)
        request = EpisodeRequest(
            episode, route, cluster_request.order.read_setting(self._registry), cluster_request.identity
        )
        return encode_episode(self._supervisor.drive(request))

    def close(self) -> None:
        self._supervisor.close()
        self._fork_server.close()


_posts: dict[tuple[WorkerSetup, Limits, str | None], _Post] = {}


def drive_on_node(content: bytes) -> bytes:
    """Drive a pickled `ClusterRequest`; return `RECORD` with the record, or `UNUSABLE` and why. A task of Ray's."""
    cluster_request: ClusterRequest = pickle.loads(content)
    place = cluster_request.worker_setup, cluster_request.limits, os.environ.get(_DEVICES)
    try:
        if place not in _posts:
            while _posts:  # Ray gave this process other devices: children that saw the old ones are of no use
                _posts.popitem()[1].close()
            _posts[place] = _Post(cluster_request)
        return RECORD + _posts[place].drive(cluster_request)
    except UsageError as error:
        return UNUSABLE + refused(error)


def refused(error: UsageError) -> bytes:
    """A usage error on its way to the controller."""
    return json.dumps({"type": type(error).__name__, "text": str(error)}).encode()
