"""What changes the identity of a world, and what does not."""

from __future__ import annotations

import ast
import os
from pathlib import Path

import pytest

import pytest_drive_robust
from pytest_drive_robust import simulators
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.cache_key import distributions, identity, source_files
from pytest_drive_robust.runner.cache_key.identity import (
    simulator_identity,
)
from pytest_drive_robust.runner.cache_key.named_files import file_digests
from pytest_drive_robust.runner.cache_key.source_files import file_of, file_of_name
from pytest_drive_robust.simulators import embedded
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator


def test_files_that_a_world_names_are_in_the_key(tmp_path):
    registry = Registry()
    registry.register_simulator("fake", FakeSimulator)

    def identity_of_world(**attributes):
        world = FakeSimulator()
        vars(world).update(attributes)
        return simulator_identity("fake", registry, world, SimulatorOptions())

    bare = identity_of_world()
    (tmp_path / "road.json").write_text("1")
    first = identity_of_world(files=(tmp_path / "road.json",))
    (tmp_path / "road.json").write_text("20")
    assert len({bare, first, identity_of_world(files=(tmp_path / "road.json",))}) == 3
    assert identity_of_world(files=()) == bare


@pytest.mark.parametrize("changed", ["size", "time", "folder"])
def test_a_file_counts_that_changed_in_size_or_time_or_place_alone(tmp_path, monkeypatch, changed):
    class World:
        files = ("road.json",)

    def digest_in(folder, content, changed_ns):
        (tmp_path / folder).mkdir(exist_ok=True)
        monkeypatch.chdir(tmp_path / folder)
        Path("road.json").write_text(content)
        os.utime("road.json", ns=(changed_ns, changed_ns))
        return file_digests(World)

    others = {"size": ("one", "10", 10**18), "time": ("one", "2", 2 * 10**18), "folder": ("other", "2", 10**18)}
    assert digest_in("one", "1", 10**18) != digest_in(*others[changed])


def test_a_source_of_a_world_without_a_file_is_known_to_nobody_but_this_session(monkeypatch):
    registry, world = Registry(), FakeSimulator()
    registry.register_simulator("fake", FakeSimulator)
    world.sources = ("sys",)
    here = simulator_identity("fake", registry, world, SimulatorOptions())
    assert simulator_identity("fake", registry, world, SimulatorOptions()) == here
    monkeypatch.setattr("pytest_drive_robust.runner.cache_key.code_text.SESSION", "another")
    assert simulator_identity("fake", registry, world, SimulatorOptions()) != here


def test_versions_count_in_a_gymnasium_world_whoever_drives(other_versions):
    registry, options = default_registry(), SimulatorOptions()
    name = "gymnasium:highway-v0"
    world = registry.simulator(name, options)
    first = simulator_identity(name, registry, world, options)
    assert {"gymnasium", "highway-env", "numpy"} < set(world.versions())
    other_versions()
    assert simulator_identity(name, registry, world, options) != first


def test_what_registers_a_gymnasium_world_counts(module):
    import gymnasium

    registry, options = default_registry(), SimulatorOptions()
    name = "gymnasium:registering_mine:mine-v0"

    def identity_at(duration: int) -> str:
        text = "import gymnasium\ngymnasium.register(id='mine-v0', entry_point='highway_env.envs:HighwayEnv'"
        module("registering_mine", f"{text}, kwargs={{'render_mode': None}})  # {duration}\n")
        try:
            return simulator_identity(name, registry, registry.simulator(name, options), options)
        finally:
            del gymnasium.registry["mine-v0"]

    assert identity_at(40) == identity_at(40) != identity_at(50)


def test_options_versions_and_code_of_a_simulator_count(module):
    registry = Registry()
    registry.register_simulator("fake", FakeSimulator)

    def digest(world=None, **options: object) -> str:
        return simulator_identity("fake", registry, world or FakeSimulator(), SimulatorOptions(**options))

    first = digest()
    assert digest(tick_cap=4000) == first
    other_version, other_library, other_tick, other_name = (FakeSimulator() for _ in range(4))
    other_version.version = "99"
    other_name.name = "another"
    other_library.versions = lambda: {"physics": "2"}
    other_tick.dt_s = 0.1
    world = FakeSimulator()
    module("environment_of_mine", "LIMIT = 1\n")
    world.sources = ("environment_of_mine",)
    digests = [first, digest(tick_cap=10), digest(stuck_stop_s=3.0), digest(world)]
    digests += [digest(one) for one in (other_version, other_library, other_tick, other_name)]
    module("environment_of_mine", "LIMIT = 2\n")
    digests.append(digest(world))
    assert len(set(digests)) == len(digests)


def test_what_else_decides_an_episode_in_a_world_counts(monkeypatch):
    monkeypatch.setattr(identity, "code_of", lambda factory: "the same")
    registry = Registry()
    for name in ("fake", "other"):
        registry.register_simulator(name, FakeSimulator)

    def digest(name="fake"):
        return simulator_identity(name, registry, FakeSimulator(), SimulatorOptions())

    digests = [digest(), digest("other")]
    with monkeypatch.context() as patched:
        patched.setattr(identity, "FORMAT_VERSION", 99)  # a record of before would be read as one of now
        digests.append(digest())
    with monkeypatch.context() as patched:
        patched.setattr(distributions, "python_version", lambda: {"python": "4.0"})
        digests.append(digest())
    assert len(set(digests)) == len(digests)


def test_the_code_of_all_worlds_is_in_the_keys_of_those_that_are_not_the_default(monkeypatch):
    registry, options, asked = default_registry(), SimulatorOptions(), []
    monkeypatch.setattr(source_files, "code_digest", lambda modules: asked.append(tuple(modules)) or "")
    for name in ("embedded", "gymnasium:highway-v0"):
        simulator_identity(name, registry, registry.simulator(name, options), options)
    assert [modules[-1] for modules in asked] == [embedded, simulators]


@pytest.mark.parametrize("start", ["runner/episode/loop.py", "simulators/embedded/simulator.py"])
def test_all_of_our_code_that_decides_numbers_is_in_the_identity(start):
    """Follows the imports of the loop and of the default world: nothing of ours may be left out by accident."""
    root = Path(pytest_drive_robust.__file__).parent
    files = [*map(file_of_name, identity._DECIDING), file_of(embedded)]
    inside = [file.parent if file.name == "__init__.py" else file for file in files]
    todo, seen = [root / start], set()
    while todo:
        path = todo.pop()
        if path in seen:
            continue
        seen.add(path)
        todo += _own_imports(path, root)
    left_out = {path for path in seen if not any(path == part or part in path.parents for part in inside)}
    assert {path.relative_to(root).as_posix() for path in left_out} <= {
        "__init__.py",
        "errors.py",  # words only
        "simulators/__init__.py",
        "store/episode_fields.py",  # refuses what no record takes, and changes nothing
    }
    assert len(seen) > 10


def _own_imports(path, root):
    tree = ast.parse(path.read_text())
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and id(node) not in typing_only:
            for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names)):
                package, *parts = name.split(".")
                place = root.joinpath(*parts)
                if package == root.name:
                    yield from (file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file())
