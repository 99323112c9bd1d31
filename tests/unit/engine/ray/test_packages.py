from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pytest_drive_robust.engine.ray.packages import NodePackages, contents_of
from pytest_drive_robust.engine.worker_setup import WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry

MODULE = "packed_agents"
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


def pytest_drive_robust_register(registry):
    registry.register_agent("packed", Agent)
"""


@pytest.fixture
def file(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / f"{MODULE}.py").write_text(SOURCE)
    (folder / "weights.bin").write_bytes(b"0123")
    yield folder / f"{MODULE}.py"
    for name in (MODULE, "policy.heads.deep"):
        sys.modules.pop(name, None)


def loaded(file: Path, name: str = MODULE) -> object:
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Agent


def recipe_in(folder: Path, *plugins: tuple[str, str]) -> WorkerSetup:
    return WorkerSetup(
        (str(folder / "src"), str(folder), *sys.path), str(folder), plugins, "pytest_drive_robust.testing:FakeSimulator"
    )


def test_what_lies_in_the_folder_of_the_run_travels_with_it(file):
    packages = NodePackages.of(recipe_in(file.parent), [loaded(file)])
    assert packages.packages == ()
    assert "py_modules" not in packages.runtime_env()
    assert packages.runtime_env()["working_dir"] == str(file.parent)


def test_what_was_installed_stays_at_home(tmp_path):
    assert NodePackages.of(recipe_in(tmp_path), [np.random.Generator, dict]).packages == ()


def test_a_package_from_elsewhere_is_packed_once(tmp_path, file):
    other = tmp_path / "elsewhere" / "policy" / "heads" / "deep.py"
    other.parent.mkdir(parents=True)
    other.write_text(SOURCE)
    agent = loaded(other, "policy.heads.deep")
    packages = NodePackages.of(recipe_in(file.parent, ("single", str(tmp_path / "single.py"))), [agent, agent])
    assert packages.packages == (str(tmp_path / "elsewhere" / "policy"), str(tmp_path / "single.py"))


def test_paths_are_found_where_the_folder_was_unpacked(tmp_path, file, monkeypatch):
    worker_setup = recipe_in(file.parent, (MODULE, str(file)), ("installed", "/somewhere/else.py"))
    packages = NodePackages.of(recipe_in(file.parent), [])
    node = tmp_path / "node"
    node.mkdir()
    monkeypatch.chdir(node)
    unpacked = packages.unpacked(worker_setup)
    assert unpacked.folder == str(node)
    assert unpacked.python_path[:2] == (str(node / "src"), str(node))
    assert str(file.parent) not in unpacked.python_path
    assert unpacked.plugins == ((MODULE, str(node / f"{MODULE}.py")), ("installed", "/somewhere/else.py"))


def test_a_node_with_the_same_code_and_weights_may_drive(file):
    worker_setup, packages = announced(file)
    packages.check(worker_setup, "packed")
    packages.check(worker_setup, "somebody of whom nothing is known")


@pytest.mark.parametrize(("name", "what"), [("weights.bin", "weights"), (f"{MODULE}.py", "code or configuration")])
def test_a_node_with_other_code_or_weights_is_refused(file, name, what):
    worker_setup, packages = announced(file)
    with (file.parent / name).open("a") as changed:
        changed.write("\n# changed\n")
    with pytest.raises(UsageError, match=rf"would drive with another {what} for 'packed'"):
        packages.check(worker_setup, "packed")


def test_a_node_that_cannot_load_the_agent_says_why(file):
    worker_setup, packages = announced(file)
    file.write_text("import a_module_that_nobody_has\n")
    with pytest.raises(UsageError, match=r"cannot load the agent 'packed': .*a_module_that_nobody_has"):
        packages.check(worker_setup, "packed")


def announced(file: Path) -> tuple[WorkerSetup, NodePackages]:
    """The packages of a run with the agent in `file`."""
    registry = Registry()
    registry.register_agent("packed", loaded(file))  # type: ignore[arg-type]
    worker_setup = recipe_in(file.parent, (MODULE, str(file)))
    packed = NodePackages.of(worker_setup, [])
    return worker_setup, replace(
        packed, contents=(("packed", contents_of(registry, "packed", worker_setup=worker_setup)),)
    )
