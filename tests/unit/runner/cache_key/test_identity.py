"""What changes the identity of an agent, and what does not."""

from __future__ import annotations

import functools
from importlib import metadata

import pytest
from agent_identities import AGENT, identity_with

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.cache_key import distributions, identity
from pytest_drive_robust.runner.cache_key.code_text import SESSION, code_of
from pytest_drive_robust.runner.cache_key.identity import (
    agent_identity,
    identity_of,
    route_digest,
)
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, fake_route


def test_the_digest_of_a_route_is_of_all_that_it_says():
    assert route_digest(fake_route("1")) == route_digest(fake_route("1"))
    assert (
        len({route_digest(route) for route in (fake_route("1"), fake_route("2"), fake_route("1", length_m=61.0))}) == 3
    )


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
    monkeypatch.setattr(distributions, "version_of", lambda top, origin: "another" if top == "numpy" else "same")
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

    def identity_here():
        return identity_of(name, registry, simulator="embedded", world=world, options=options)

    before = identity_here()
    other_versions()
    assert (identity_here() != before) is counts


def test_an_agent_names_what_its_bits_depend_on(module, monkeypatch):
    agent = module("lonely_agent", "import numpy\nimport cv2\n" + AGENT).Agent

    def counts(library):
        found = []
        for version in ("1", "2"):
            versions = {library: version}
            monkeypatch.setattr(distributions, "version_of", lambda top, origin, known=versions: known.get(top, "same"))
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


def test_the_name_of_the_agent_counts(module):
    agent = module("lonely_agent", AGENT).Agent
    assert identity_with(agent, "one") != identity_with(agent, "two")


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


def test_lockstep_is_another_identity():
    registry = Registry()
    registry.register_agent("mine", Factory)
    registry.register_simulator("fake", FakeSimulator)
    given_ = {"simulator": "fake", "world": FakeSimulator(), "options": SimulatorOptions()}
    single, again, lockstep = (
        identity_of("mine", registry, mode=mode, **given_) for mode in ("single", "single", "lockstep")
    )
    assert single == again != lockstep


class Factory:
    """An agent's factory with a state."""

    def __init__(self, gain: object = 1.0) -> None:
        self.gain = gain

    def __call__(self) -> object:
        return self

    def make(self) -> object:
        return self


def test_a_library_that_is_no_name_is_refused(module):
    made = module("computing", AGENT)
    made.Agent.computed_by = 3
    with pytest.raises(UsageError, match="`computed_by` of an agent is 3, expected names of modules"):
        identity_with(made.Agent)
