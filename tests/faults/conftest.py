"""Supervisors for the tests of this folder, their workers forked from one fork server."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from guarded_worlds import worker_setup

from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits

LIMITS = Limits(episode_s=300.0, act_s=2.0)
"""A call of these agents takes microseconds, or hangs: on a busy machine nobody waits two seconds for a core."""


@pytest.fixture(scope="session")
def fork_server() -> Iterator[ForkServer]:
    made = ForkServer(worker_setup())
    yield made
    made.close()


@pytest.fixture
def make_supervisor(fork_server: ForkServer) -> Iterator[Callable[..., Supervisor]]:
    """`make_supervisor(limits)`, or `make_supervisor(limits, simulator, ...)` for one with a fork server of its own."""
    supervisors: list[Supervisor] = []
    fork_servers: list[ForkServer] = []

    def make(limits: Limits = LIMITS, simulator: str | None = None, **changes: object) -> Supervisor:
        if simulator is not None:
            fork_servers.append(ForkServer(worker_setup(simulator, **changes)))
        supervisors.append(Supervisor(fork_servers[-1] if simulator is not None else fork_server, limits))
        return supervisors[-1]

    yield make
    for supervisor in supervisors:
        supervisor.close()
    for own in fork_servers:
        own.close()


@pytest.fixture
def supervisor(make_supervisor: Callable[..., Supervisor]) -> Supervisor:
    return make_supervisor()
