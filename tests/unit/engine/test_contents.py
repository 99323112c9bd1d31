"""A process drives the version of an agent that was announced, or refuses."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_drive_robust.engine.contents import check_contents, contents_of
from pytest_drive_robust.engine.worker_setup import WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import FakeSimulator

MODULE = "announced_agents"
SOURCE = """
from pathlib import Path


class Agent:
    weights = [Path(__file__).parent / "weights.bin"]

    def sensors(self):
        return ()

    def reset(self, route, seed):
        pass

    def act(self, observation):
        return None
"""


@pytest.fixture
def file(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / f"{MODULE}.py").write_text(SOURCE)
    (tmp_path / "weights.bin").write_bytes(b"0123")
    yield tmp_path / f"{MODULE}.py"
    sys.modules.pop(MODULE, None)


def registry_of(file: Path) -> Registry:
    """The names of a process that loads the module now."""
    spec = importlib.util.spec_from_file_location(MODULE, file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[MODULE] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    registry = Registry()
    registry.register_agent("packed", module.Agent)
    return registry


def announced(file: Path) -> WorkerSetup:
    setup = WorkerSetup((), str(file.parent), (), "pytest_drive_robust.testing:FakeSimulator")
    contents = contents_of(registry_of(file), "packed", worker_setup=setup, world=FakeSimulator())
    return replace(setup, contents=(("packed", contents),))


def test_the_same_code_and_weights_may_drive(file: Path) -> None:
    setup = announced(file)
    check_contents(registry_of(file), "packed", worker_setup=setup, world=FakeSimulator)


def test_an_agent_of_which_nothing_was_announced_may_drive(file: Path) -> None:
    check_contents(Registry(), "somebody", worker_setup=announced(file), world=FakeSimulator)


@pytest.mark.parametrize(("name", "what"), [("weights.bin", "weights"), (f"{MODULE}.py", "code or configuration")])
def test_other_code_or_weights_are_refused(file: Path, name: str, what: str) -> None:
    setup = announced(file)
    with (file.parent / name).open("a") as changed:
        changed.write("\n# changed\n")
    with pytest.raises(UsageError, match=rf"would drive with another {what} for 'packed'"):
        check_contents(registry_of(file), "packed", worker_setup=setup, world=FakeSimulator)


def test_weights_that_are_not_there_are_told(file: Path) -> None:
    setup = announced(file)
    (file.parent / "weights.bin").unlink()
    with pytest.raises(UsageError, match=r"names the weights .* cannot be read"):
        check_contents(registry_of(file), "packed", worker_setup=setup, world=FakeSimulator)
