"""What changes the key of a stored episode, and what does not."""

from __future__ import annotations

import ast
import functools
import os
import subprocess
import sys
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest

import pytest_drive_robust
from pytest_drive_robust import simulators
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import GpsNoise, Setting
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.cache_key import identity, source_files
from pytest_drive_robust.runner.cache_key.canonical_text import SESSION, code_of, digest_of, file_digests
from pytest_drive_robust.runner.cache_key.identity import (
    agent_identity,
    identity_of,
    route_digest,
    simulator_identity,
)
from pytest_drive_robust.runner.cache_key.source_files import file_of, file_of_name
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators import embedded
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, fake_route

SETTING = Setting.of(GpsNoise(std_m=5))

REQUEST = EpisodeRequest(Episode("driver", "1", str(SETTING), 0), fake_route("1"), SETTING, "some identity")

AGENT = """
class Agent:
    gain = 1.0
    def sensors(self): return ()
    def reset(self, route, seed): pass
    def act(self, observation): return None

def make(gain): return lambda: Agent(gain)
"""


def identity_with(factory, name="mine"):
    registry = Registry()
    registry.register_agent(name, factory)
    return agent_identity(name, registry)


@pytest.mark.parametrize(
    "other",
    [
        replace(REQUEST, identity="another"),
        replace(REQUEST, episode=replace(REQUEST.episode, seed=1)),
        replace(REQUEST, episode=replace(REQUEST.episode, agent="other")),
        replace(REQUEST, episode=replace(REQUEST.episode, setting="GPS noise 6 m")),
        replace(REQUEST, route=fake_route("1", length_m=61.0)),
    ],
    ids=["identity", "seed", "agent", "setting", "route"],
)
def test_each_part_of_a_request_changes_its_key(other):
    assert other.key != REQUEST.key


def test_a_key_is_hex_and_the_same_in_every_process():
    program = "import sys; sys.path[:0] = sys.argv[1:]\nfrom test_identity import REQUEST\nprint(REQUEST.key)"
    command = [sys.executable, "-c", program, str(Path(__file__).parent)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == REQUEST.key
    assert len(bytes.fromhex(REQUEST.key)) == 16


def test_the_digest_of_a_route_is_of_all_that_it_says():
    assert route_digest(fake_route("1")) == route_digest(fake_route("1"))
    assert (
        len({route_digest(route) for route in (fake_route("1"), fake_route("2"), fake_route("1", length_m=61.0))}) == 3
    )


def test_numbers_count_by_their_value():
    one, other = (replace(fake_route("1"), weather=replace(REQUEST.route.weather, wetness=wet)) for wet in (5, 5.0))
    assert replace(REQUEST, route=one).key == replace(REQUEST, route=other).key
    assert digest_of(-0.0) == digest_of(0)
    assert digest_of("5") != digest_of(5)
    assert digest_of(True) != digest_of(1)


def test_the_source_of_a_perturbation_that_is_not_ours_is_in_the_key(module):
    text = (
        "from dataclasses import dataclass\nfrom pytest_drive_robust.perturbations import Perturbation\n"
        "@dataclass\nclass Foggy(Perturbation):\n    metres: float = 5.0\n    phrase = 'fog {metres} m'\n"
    )
    keys = []
    for changed in (text, text + "# a comment\n", text):
        setting = Setting.of(module("foggy_module", changed).Foggy())
        keys.append(replace(REQUEST, setting=setting).key)
    assert keys[0] == keys[2] != keys[1]


def test_files_that_a_perturbation_names_are_in_the_key(module, tmp_path):
    text = (
        "from dataclasses import dataclass\nfrom typing import ClassVar\n"
        "from pytest_drive_robust.perturbations import Perturbation\n"
        "@dataclass\nclass Foggy(Perturbation):\n    metres: float = 5.0\n    phrase = 'fog {metres} m'\n"
        f"    files: ClassVar = ({str(tmp_path / 'table.txt')!r},)\n"
    )
    request = replace(REQUEST, setting=Setting.of(module("foggy_files_module", text).Foggy()))
    with pytest.raises(UsageError, match=r"table\.txt', which cannot be read: No such file"):
        _ = request.key
    keys = []
    for content in ("3", "60", "3"):
        (tmp_path / "table.txt").write_text(content)
        keys.append(replace(request).key)
    assert keys[0] == keys[2] != keys[1]


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


def test_a_source_of_a_world_without_a_file_is_known_to_nobody_but_this_session(monkeypatch):
    registry, world = Registry(), FakeSimulator()
    registry.register_simulator("fake", FakeSimulator)
    world.sources = ("sys",)
    here = simulator_identity("fake", registry, world, SimulatorOptions())
    assert simulator_identity("fake", registry, world, SimulatorOptions()) == here
    monkeypatch.setattr("pytest_drive_robust.runner.cache_key.canonical_text.SESSION", "another")
    assert simulator_identity("fake", registry, world, SimulatorOptions()) != here


def test_one_byte_of_an_agents_package_changes_its_identity(module):
    module("driving_pkg.__init__", "")
    first = identity_with(module("driving_pkg.agent", AGENT).Agent)
    assert identity_with(module("driving_pkg.agent", AGENT).Agent) == first
    module("driving_pkg.tables", "LIMIT = 5\n")
    second = identity_with(module("driving_pkg.agent", AGENT).Agent)
    module("driving_pkg.tables", "LIMIT = 6\n")
    third = identity_with(module("driving_pkg.agent", AGENT).Agent)
    assert len({first, second, third, identity_with(module("driving_pkg.agent", AGENT + "#").Agent)}) == 4


def test_a_settings_file_in_the_package_counts_and_what_runs_leave_does_not(module, tmp_path):
    module("driving_pkg.__init__", "")
    first = identity_with(module("driving_pkg.agent", AGENT).Agent)
    for name in ("__pycache__/x.py", ".cache/y.py", "log.txt", "frames.png"):
        (tmp_path / "driving_pkg" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "driving_pkg" / name).write_text("x")
    assert identity_with(module("driving_pkg.agent", AGENT).Agent) == first
    found = [first]
    for name in ("gains.yaml", "gains.json", "gains.toml", "gains.ini", "kernel.so", "kernel.pyx"):
        (tmp_path / "driving_pkg" / name).write_text("kp: 1")
        found.append(identity_with(module("driving_pkg.agent", AGENT).Agent))
    assert len(set(found)) == len(found)


@pytest.mark.parametrize(
    "line",
    [
        "import helper_mod\n",
        "from helper_mod import LIMIT\n",
        "def late():\n    from helper_mod import (\n        LIMIT,\n    )\n",
        "from helper_space.deep import inner\n",
        "from helper_space.deep import (\n    inner,  # (what it steers by)\n)\n",
        "from helper_space.deep import \\\n    inner\n",
        "import helper_space.deep.inner as short\n",
        "import os, helper_mod\n",
        "import helper_pkg\n",
    ],
)
def test_what_an_agent_imports_from_beside_it_counts(module, line):
    def identity_of_agent(limit: int) -> str:
        for name in ("helper_mod", "helper_space.deep.inner", "helper_pkg.__init__"):
            module(name, f"LIMIT = {limit}\n")
        return identity_with(module("lonely_agent", line + AGENT).Agent)

    assert identity_of_agent(5) == identity_of_agent(5) != identity_of_agent(6)


def test_a_circle_of_imports_ends(module):
    module("helper_mod", "def late():\n    import lonely_agent\n")
    assert identity_with(module("lonely_agent", "def late():\n    import helper_mod\n" + AGENT).Agent)


def test_an_installed_distribution_counts_by_its_version(module, monkeypatch):
    agent = module("lonely_agent", "import numpy\nimport cv2\n" + AGENT).Agent
    first = identity_with(agent)
    monkeypatch.setattr(source_files, "_version", lambda top, origin: "another" if top == "numpy" else "same")
    assert identity_with(agent) != first


def test_a_commit_of_a_distribution_is_no_part_of_its_version_but_a_release_is(monkeypatch):
    def identity_from(version):
        distribution = type("Installed", (), {"name": "some-agents", "version": version})
        point = metadata.EntryPoint("constant", "drive_robust_agents.constant:Constant", "pytest_drive_robust.agents")
        vars(point)["dist"] = distribution
        monkeypatch.setattr(metadata, "entry_points", lambda: metadata.EntryPoints([point]))
        return agent_identity("constant", Registry())

    first = identity_from("1.3.0")
    assert {identity_from(version) for version in ("1.3.0.dev5+g1a2b3c4", "1.3.0.dev6", "1.3.0+local")} == {first}
    assert len({first, identity_from("1.3.1"), identity_from("1.3.0rc1"), identity_from("1.3.0.post1")}) == 4


@pytest.fixture
def other_versions(monkeypatch):
    """Return what pretends that Python and all installed libraries have other versions."""

    def pretend() -> None:
        monkeypatch.setattr(source_files, "_version", lambda top, origin: f"another {top}")
        monkeypatch.setattr(source_files, "_python", lambda: {"python": "4.0"})

    return pretend


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("classical", False), ("constant", False), ("expert", False), ("random", False), ("reactive", False),
        ("tcp", True),
    ],
)  # fmt: skip
def test_versions_of_libraries_are_in_the_keys_of_agents_whose_bits_depend_on_them(name, counts, other_versions):
    registry, options = default_registry(), SimulatorOptions()
    world = registry.simulator("embedded", options)

    def key():
        identity = identity_of(name, registry, simulator="embedded", world=world, options=options)
        return replace(REQUEST, identity=identity).key

    here = key()
    other_versions()
    assert (key() != here) is counts


def test_an_agent_names_what_its_bits_depend_on(module, monkeypatch):
    agent = module("lonely_agent", "import numpy\nimport cv2\n" + AGENT).Agent

    def counts(library):
        found = []
        for version in ("1", "2"):
            versions = {library: version}
            monkeypatch.setattr(source_files, "_version", lambda top, origin, known=versions: known.get(top, "same"))
            found.append(identity_with(agent))
        return found[0] != found[1]

    assert (counts("numpy"), counts("cv2")) == (True, True)
    agent.computed_by = ("numpy",)
    assert (counts("numpy"), counts("cv2")) == (True, False)
    agent.portable_bits = True
    assert (counts("numpy"), counts("cv2")) == (False, False)


def test_a_changed_agent_with_portable_bits_is_driven_again(module):
    text = AGENT.replace("gain = 1.0", "gain = 1.0; portable_bits = True")
    assert identity_with(module("lonely_agent", text).Agent) != identity_with(module("lonely_agent", text + "#").Agent)


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


def test_the_name_of_the_agent_counts(module):
    agent = module("lonely_agent", AGENT).Agent
    assert identity_with(agent, "one") != identity_with(agent, "two")


def test_weights_count_by_their_content(module, tmp_path):
    agent = module("lonely_agent", AGENT).Agent
    weights = tmp_path / "weights.pt"
    agent.weights = (weights,)
    identities = []
    for content in (b"12345", b"12346", b"12345"):
        weights.write_bytes(content)
        identities.append(identity_with(agent))
    assert identities[0] == identities[2] != identities[1]
    weights.unlink()
    with pytest.raises(UsageError, match="names the weights"):
        identity_with(agent)


def test_a_folder_of_weights_counts_by_the_names_and_contents_of_its_files(module, tmp_path):
    agent = module("lonely_agent", AGENT).Agent
    folder = tmp_path / "checkpoint"
    (folder / "shards").mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    (folder / "shards" / "1.bin").write_bytes(b"12345")
    (folder / "shards" / "around").symlink_to(folder)
    agent.weights = (folder,)
    first = identity_with(agent)
    (folder / ".lock").write_text("held")
    assert identity_with(agent) == first, "hidden files do not count"
    (folder / "shards" / "1.bin").write_bytes(b"12346")
    second = identity_with(agent)
    (folder / "shards" / "1.bin").rename(folder / "shards" / "2.bin")
    third = identity_with(agent)
    linked = tmp_path / "elsewhere"
    linked.mkdir()
    (folder / "more").symlink_to(linked)
    assert identity_with(agent) == third
    (linked / "3.bin").write_bytes(b"1")
    assert len({first, second, third, identity_with(agent)}) == 4


def test_all_of_a_large_weight_file_counts(module, tmp_path, monkeypatch):
    monkeypatch.setattr(source_files, "_BLOCK_BYTES", 4)
    agent = module("lonely_agent", AGENT).Agent
    agent.weights = tmp_path / "weights.pt"
    identities = []
    for content in (b"1234567890", b"1234567891", b"1234567890"):
        agent.weights.write_bytes(content)
        identities.append(identity_with(agent))
    assert identities[0] == identities[2] != identities[1]


def test_the_configuration_of_an_agent_counts(module):
    agent = module("lonely_agent", AGENT).Agent
    agent.configuration = {"gain": 1}
    first = identity_with(agent)
    agent.configuration = {"gain": 1.0}
    assert identity_with(agent) == first
    agent.configuration = {"gain": 2}
    assert identity_with(agent) != first
    agent.configuration = object()
    with pytest.raises(UsageError, match="expected plain values that can be compared"):
        identity_with(agent)


def test_what_a_factory_was_made_with_counts(module):
    made = module("lonely_agent", AGENT)
    codes = [
        code_of(made.make(1.0)),
        code_of(made.make(2.0)),
        code_of(functools.partial(made.Agent, 1.0)),
        code_of(functools.partial(made.Agent, 2.0)),
        code_of(functools.partial(made.Agent, gain=2.0)),
        code_of(lambda gain=1.0: made.Agent(gain)),
        code_of(lambda gain=2.0: made.Agent(gain)),
    ]
    assert len(set(codes)) == len(codes)
    assert not any(SESSION in text for text in codes)
    assert code_of(made.make(1.0)) == codes[0]
    assert code_of(functools.partial(made.Agent, 1)) == codes[2]


def test_a_factory_object_counts_with_its_state():
    one, same, other = (Factory(gain) for gain in (1.0, 1.0, 2.0))
    assert code_of(one) == code_of(same) != code_of(other)
    assert code_of(one.make) == code_of(same.make) != code_of(other.make)


TESTS = "class TestMore:\n    def test_it(self): pass\n"


@pytest.mark.parametrize("name", ["Agent", "TestAgent", "testing_agent"])
def test_an_agent_beside_tests_counts_whatever_its_name(module, name):
    class_of = "def test_gain(): return 1.0\n" + AGENT.replace("Agent", name).replace("1.0", "test_gain()")
    assert "test_gain()" in class_of
    first, second = (
        identity_with(getattr(module("test_suite_of_mine", class_of.replace("1.0", gain)), name))
        for gain in ("1.0", "2.0")
    )
    assert first != second


@pytest.mark.parametrize(
    ("name", "counts"), [("test_suite_of_mine", False), ("suite_of_mine_test", False), ("agents_of_mine", True)]
)
def test_renaming_a_test_beside_an_agent_drives_nothing_again(module, name, counts):
    first = identity_with(module(name, AGENT + "def test_one(): pass\n").Agent)
    second = identity_with(module(name, AGENT + "def test_two(): pass\n" + TESTS).Agent)
    assert (first != second) is counts
    assert identity_with(module(name, AGENT.replace("1.0", "2.0")).Agent) not in (first, second)


def test_moving_an_agents_only_file_drives_nothing_again(module):
    assert identity_with(module("before_it", AGENT).Agent) == identity_with(module("after_it", AGENT).Agent)


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
        patched.setattr(source_files, "_python", lambda: {"python": "4.0"})
        digests.append(digest())
    assert len(set(digests)) == len(digests)


def test_the_code_of_lockstep_is_in_the_keys_of_what_it_drives(module, monkeypatch):
    monkeypatch.setattr(identity, "simulator_identity", lambda *_: "a world")
    monkeypatch.setattr(identity, "_LOCKSTEP", "batch_of_mine")
    registry = Registry()
    registry.register_agent("mine", module("lonely_agent", AGENT).Agent)
    given_ = {"simulator": "fake", "world": FakeSimulator(), "options": SimulatorOptions()}

    def identities(limit):
        module("batch_of_mine", f"LIMIT = {limit}\n")
        module("lonely_agent", AGENT)
        return [identity_of("mine", registry, mode=mode, **given_) for mode in ("single", "lockstep")]

    (single, lockstep), (same, other) = identities(5), identities(6)
    assert single == same
    assert lockstep != other


def test_the_code_of_all_worlds_is_in_the_keys_of_those_that_are_not_the_default(monkeypatch):
    registry, options, asked = default_registry(), SimulatorOptions(), []
    monkeypatch.setattr(source_files, "code_digest", lambda modules: asked.append(tuple(modules)) or "")
    for name in ("embedded", "gymnasium:highway-v0"):
        simulator_identity(name, registry, registry.simulator(name, options), options)
    assert [modules[-1] for modules in asked] == [embedded, simulators]


def test_lockstep_is_another_identity():
    registry = Registry()
    registry.register_agent("mine", Factory)
    registry.register_simulator("fake", FakeSimulator)
    given_ = {"simulator": "fake", "world": FakeSimulator(), "options": SimulatorOptions()}
    single, again, lockstep = (
        identity_of("mine", registry, mode=mode, **given_) for mode in ("single", "single", "lockstep")
    )
    assert single == again != lockstep


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


class Factory:
    """An agent's factory with a state."""

    def __init__(self, gain: object = 1.0) -> None:
        self.gain = gain

    def __call__(self) -> object:
        return self

    def make(self) -> object:
        return self


@pytest.mark.parametrize("weights", [[0.3, 0.7], 3, property(lambda self: "w.pt")])
def test_weights_that_are_no_files_are_refused(module, weights):
    made = module("weighing", AGENT)
    made.Agent.weights = weights
    with pytest.raises(UsageError, match=r"`weights` of the agent 'mine' is .*expected the paths of its weight files"):
        identity_with(made.Agent)


def test_no_weights_are_none(module):
    made = module("weighing", AGENT)
    without = identity_with(made.Agent)
    made.Agent.weights = None
    assert identity_with(made.Agent) == without


def test_a_library_that_is_no_name_is_refused(module):
    made = module("computing", AGENT)
    made.Agent.computed_by = 3
    with pytest.raises(UsageError, match="`computed_by` of an agent is 3, expected names of modules"):
        identity_with(made.Agent)
