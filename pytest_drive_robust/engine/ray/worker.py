"""What runs on the nodes of a Ray cluster: a supervisor in each of Ray's worker processes.

A fault of the agent ends a process below the supervisor and reaches Ray as a normal result. So an error that Ray itself
reports is the loss of a node or of Ray's own worker, and worth another attempt.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.messages import WorkerRequest
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.bare_result import bare_result


@dataclass(frozen=True, slots=True)
class ClusterRequest:
    """One episode for a node of the cluster. `is_copied` says that Ray copied the folder of the run to the node."""

    worker_setup: WorkerSetup
    limits: Limits
    request: WorkerRequest
    is_copied: bool = False

    def lost(self, why: str) -> EpisodeResult:
        """Return the result of an episode that the cluster lost."""
        detail, end = f"the episode was lost on the cluster: {why}", End.SIMULATION_CRASHED
        return bare_result(
            self.request.route, self.request.episode, outcome=Outcome.INFRA_ERROR, end=end, detail=detail
        )


_supervisors: dict[tuple[WorkerSetup, Limits, str | None], tuple[ForkServer, Supervisor]] = {}
"""The supervisor of this process, at most one, by setup, limits and visible devices."""


def drive_on_node(asked: ClusterRequest) -> EpisodeResult | UsageError:
    """Return the result of an episode, or the error why the episode cannot be driven. Runs as a Ray task."""
    place = asked.worker_setup, asked.limits, os.environ.get("CUDA_VISIBLE_DEVICES")
    try:
        if place not in _supervisors:
            while _supervisors:  # Ray changed this process's devices: workers that saw the old ones are useless
                fork_server, supervisor = _supervisors.popitem()[1]
                supervisor.close()
                fork_server.close()
            fork_server = ForkServer(setup_on_node(asked.worker_setup) if asked.is_copied else asked.worker_setup)
            _supervisors[place] = fork_server, Supervisor(fork_server, asked.limits)
        return _supervisors[place][1].drive_request(asked.request)
    except UsageError as error:
        return error


def setup_on_node(setup: WorkerSetup) -> WorkerSetup:
    """Return the setup with the paths of this node, whose current folder is a copy of the setup's folder.

    Code outside that folder must be installed on this node; otherwise its import or the check of identities fails.
    """
    home = Path(setup.folder).resolve()

    def on_node(path: str) -> str:
        place = Path(path).resolve()
        return str(Path.cwd() / place.relative_to(home)) if place.is_relative_to(home) else path

    moved = [here for path in setup.python_path if (here := on_node(path)) != path]
    return replace(
        setup,
        python_path=(*moved, *(path for path in sys.path if path not in moved)),
        folder=os.getcwd(),
        plugins=tuple((module, on_node(file)) for module, file in setup.plugins),
        checks_identity=True,
    )
