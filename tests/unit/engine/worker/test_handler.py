"""A worker that is told to check drives the version of an agent that was asked for, or refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from guarded_worlds import FAKE, request, worker_setup

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.cache_key.identity import identity_of
from pytest_drive_robust.testing import FakeSimulator

AGENT = "announced_agents:Agent"
SOURCE = """
from pathlib import Path
from guarded_agents import Steady


class Agent(Steady):
    weights = [Path(__file__).parent / "weights.bin"]
"""


@pytest.fixture
def setup(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> WorkerSetup:
    (tmp_path / "announced_agents.py").write_text(SOURCE)
    (tmp_path / "weights.bin").write_bytes(b"0123")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = (str(tmp_path), *worker_setup().python_path)
    return worker_setup(python_path=path, checks_identity=True)


def identity(setup: WorkerSetup) -> str:
    world = FakeSimulator(setup.options)
    return identity_of(AGENT, default_registry(), simulator=FAKE, world=world, options=setup.options)


def drive(setup: WorkerSetup, identity: str) -> Outcome:
    fork_server = ForkServer(setup)
    supervisor = Supervisor(fork_server, Limits())
    try:
        return supervisor.drive(replace(request(AGENT), identity=identity)).outcome
    finally:
        supervisor.close()
        fork_server.close()


def test_the_same_code_and_weights_may_drive(setup: WorkerSetup) -> None:
    assert drive(setup, identity(setup)) is Outcome.COMPLETED


@pytest.mark.parametrize("name", ["weights.bin", "announced_agents.py"])
def test_other_code_or_weights_are_refused(setup: WorkerSetup, tmp_path: Path, name: str) -> None:
    announced = identity(setup)
    with (tmp_path / name).open("a") as changed:
        changed.write("\n# changed\n")
    with pytest.raises(UsageError, match="has another version of the agent 'announced_agents:Agent'"):
        drive(setup, announced)


def test_weights_that_are_not_there_are_told(setup: WorkerSetup, tmp_path: Path) -> None:
    (tmp_path / "weights.bin").unlink()
    with pytest.raises(UsageError, match=r"names the weights .* cannot be read"):
        drive(setup, "")
