"""What runs on the nodes of a Ray cluster: a supervisor in each of Ray's worker processes.

A fault of the agent ends a process below the supervisor and is data by the time that Ray could see it. So whatever Ray
itself notices is the loss of a node or of its own worker, and worth another attempt.
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
from pytest_drive_robust.runner.episode.stored_controls import bare_result


@dataclass(frozen=True, slots=True)
class ClusterRequest:
    """One episode, perhaps for another machine. `is_copied`: Ray copied the folder of the run to the node."""

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
"""Of this process, at most one: for one setup and one set of devices."""


def drive_on_node(asked: ClusterRequest) -> EpisodeResult | UsageError:
    """Return what came of an episode, or why it cannot be driven. A task of Ray's."""
    place = asked.worker_setup, asked.limits, os.environ.get("CUDA_VISIBLE_DEVICES")
    try:
        if place not in _supervisors:
            while _supervisors:  # Ray gave this process other devices: children that saw the old ones are of no use
                fork_server, supervisor = _supervisors.popitem()[1]
                supervisor.close()
                fork_server.close()
            fork_server = ForkServer(setup_on_node(asked.worker_setup) if asked.is_copied else asked.worker_setup)
            _supervisors[place] = fork_server, Supervisor(fork_server, asked.limits)
        return _supervisors[place][1].drive_request(asked.request)
    except UsageError as error:
        return error


def setup_on_node(setup: WorkerSetup) -> WorkerSetup:
    """Return the setup with its paths as they are on this node, where a copy of its folder is the current one.

    What lies elsewhere is installed here as there, or else its import or the check of identities says what is missing.
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
