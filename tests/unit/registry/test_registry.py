"""Names, origins, and what happens when somebody else's entry is broken."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError
from pytest_drive_robust.perturbations import GpsNoise
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.registry.registry import Registry, default_registry, forget_names, hide_names
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent

Install = Callable[..., None]

AGENT = """
class Agent:
    def sensors(self): return []
    def reset(self, route, seed): pass
    def act(self, observation): return None
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a distribution with one module and one entry point on the path."""

    def put(distribution: str, version: str, *, group: str, entry: str, source: str) -> None:
        folder = tmp_path / distribution
        info = folder / f"{distribution}-{version}.dist-info"
        info.mkdir(parents=True)
        module = f"{distribution.replace('-', '_')}_module"
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n")
        (info / "entry_points.txt").write_text(f"[pytest_drive_robust.{group}]\n{entry} = {module}:Entry\n")
        (folder / f"{module}.py").write_text(source)
        monkeypatch.syspath_prepend(str(folder))

    return put


@dataclass
class NoisyWheel(Perturbation):
    gain: float = 0.5
    phrase = "noisy wheel {gain}"


def test_an_entry_point_is_listed_with_its_distribution_without_being_imported(install: Install) -> None:
    install("listed-agents", "1.2", group="agents", entry="careful", source="raise RuntimeError('imported')")
    assert ("careful", "listed-agents 1.2") in Registry().names("agents")
    assert "listed_agents_module" not in sys.modules


def test_an_entry_point_is_loaded_by_name_and_every_call_makes_a_new_agent(install: Install) -> None:
    install("good-agents", "1.0", group="agents", entry="good", source=AGENT + "Entry = Agent")
    registry = Registry()
    one, other = registry.agent("good"), registry.agent("good")
    assert type(one).__module__ == "good_agents_module"
    assert one is not other


@pytest.mark.parametrize(
    "source",
    [
        "import no_such_library_anywhere",
        "raise SystemExit(3)",
        "import pytest\npytest.skip('x', allow_module_level=True)",
    ],
)
def test_a_broken_entry_point_is_named_with_its_distribution_and_stops_nothing_else(
    install: Install, source: str
) -> None:
    install("broken-agents", "0.9", group="agents", entry="broken", source=source)
    install("fine-agents", "1.0", group="agents", entry="fine", source=AGENT + "Entry = Agent")
    registry = Registry()
    with pytest.raises(PluginError, match=r"'broken'.*broken-agents 0\.9"):
        registry.agent("broken")
    assert registry.agent("fine").sensors() == []


def test_a_broken_perturbation_is_left_out_of_all_and_told_as_a_problem(install: Install) -> None:
    install("broken-noise", "2.1", group="perturbations", entry="hum", source="1 / 0")
    registry = Registry()
    classes = registry.perturbations()
    assert "hum" not in classes
    assert "gps-noise" in classes
    (problem,) = registry.problems()
    assert "broken-noise 2.1" in str(problem)
    assert "ZeroDivisionError" in str(problem)


def test_an_entry_that_is_no_perturbation_is_a_plugin_error(install: Install) -> None:
    install("odd-noise", "1.0", group="perturbations", entry="odd", source="class Entry: pass")
    with pytest.raises(PluginError, match=r"odd-noise 1\.0 is not a perturbation"):
        Registry().perturbation("odd")


def test_a_name_of_two_distributions_is_an_error_that_names_both_when_it_is_asked_for(install: Install) -> None:
    install("first-agents", "1.0", group="agents", entry="same", source=AGENT + "Entry = Agent")
    install("second-agents", "2.0", group="agents", entry="same", source=AGENT + "Entry = Agent")
    registry = Registry()
    assert [name for name, _ in registry.names("agents")].count("same") == 1
    with pytest.raises(PluginError, match=r"first-agents 1\.0 and second-agents 2\.0|second.* and first"):
        registry.agent("same")


def test_a_registered_name_wins_over_an_entry_point(install: Install) -> None:
    install("plain-agents", "1.0", group="agents", entry="mine", source=AGENT + "Entry = Agent")
    registry = Registry()
    registry.register_agent("mine", _scripted)
    assert isinstance(registry.agent("mine"), ScriptedAgent)


def test_a_name_registered_by_two_definitions_is_an_error_that_names_both() -> None:
    registry = Registry()
    registry.register_agent("mine", _scripted)
    with pytest.raises(UsageError, match=r"registered twice: by .*_scripted and by .*_other_scripted"):
        registry.register_agent("mine", _other_scripted)


def test_one_factory_with_other_options_is_not_registered_under_the_same_name() -> None:
    registry = Registry()
    slow, fast = (functools.partial(_of_speed, speed_mps=speed_mps) for speed_mps in (2.0, 8.0))
    registry.register_agent("driver", slow)
    registry.register_agent("driver", functools.partial(_of_speed, speed_mps=2.0))
    with pytest.raises(UsageError, match=r"registered twice: by .*_of_speed with \{'speed_mps': 2.0\} and with"):
        registry.register_agent("driver", fast)


def test_the_same_definition_may_register_again_as_when_a_conftest_is_imported_twice() -> None:
    registry = Registry()
    registry.register_perturbation(NoisyWheel)
    registry.register_perturbation(NoisyWheel)
    assert registry.perturbation("noisy-wheel") is NoisyWheel


def test_an_unknown_name_is_answered_with_the_nearest_one_and_how_to_register() -> None:
    registry = Registry()
    registry.register_agent("expert-driver", _scripted)
    with pytest.raises(UnknownNameError, match=r"Did you mean 'expert-driver'\?.*module:Class"):
        registry.agent("expert-drivr")
    with pytest.raises(UnknownNameError, match="Did you mean 'gps-noise'"):
        registry.perturbation("gps-nose")
    with pytest.raises(UnknownNameError, match="Did you mean 'agents'"):
        registry.names("agent")


@pytest.mark.parametrize("given", ["my_own_agent", "my_own_agent.py"])
def test_a_module_in_the_place_of_its_class_is_answered_with_how_to_name_the_class(
    given: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_own_agent.py").write_text("import math\n\nclass Mine:\n    pass\n")
    with pytest.raises(UnknownNameError, match="give 'my_own_agent:Class' for the class in it"):
        Registry().agent(given)
    with pytest.raises(UnknownNameError, match=r"no object in my_own_agent named 'Yours'\. Known: Mine\."):
        Registry().agent("my_own_agent:Yours")


def test_an_agent_without_act_is_refused_by_the_name_of_the_method() -> None:
    class NoAct:
        def sensors(self) -> list[object]:
            return []

        def reset(self, route: object, seed: int) -> None: ...

    registry = Registry()
    registry.register_agent("half", NoAct)  # type: ignore[arg-type]
    with pytest.raises(PluginError, match=r"lacks act: a NoAct"):
        registry.agent("half")


def test_what_an_agent_has_from_its_constructor_counts() -> None:
    class Delegates:
        def __init__(self) -> None:
            other = _scripted()
            self.sensors, self.reset, self.act = other.sensors, other.reset, other.act

    registry = Registry()
    registry.register_agent("delegating", Delegates)
    assert registry.agent("delegating").act(None) == Control()  # type: ignore[arg-type]


def test_an_agent_whose_factory_raises_is_named() -> None:
    def without_weights() -> ScriptedAgent:
        raise FileNotFoundError("weights.pt")

    registry = Registry()
    registry.register_agent("learned", without_weights)
    with pytest.raises(PluginError, match=r"'learned' from .* could not be made: FileNotFoundError: weights\.pt"):
        registry.agent("learned")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import no_such_net\n", r"ModuleNotFoundError: No module named 'no_such_net' \(broken_agent\.py:1\)\.$"),
        ("\nimport json\nBOUNDS = json.loads('{')\n", r"JSONDecodeError: .* \(broken_agent\.py:3\)\.$"),
        ("class Mine:\n    def __init__(self):\n        {}['w']\n", r"could not be made: KeyError: 'w' \(.*\.py:3\)$"),
        ("class Mine:\n    def act(:\n", r"does not load: SyntaxError: .*\(broken_agent\.py, line 2\)\.$"),
    ],
    ids=["import", "body", "constructor", "syntax"],
)
def test_an_agent_that_breaks_is_told_with_the_line_in_its_file(tmp_path, monkeypatch, text, told):
    (tmp_path / "broken_agent.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "broken_agent", raising=False)
    with pytest.raises(PluginError, match=told):
        Registry().agent("broken_agent:Mine")


def test_a_factory_that_gives_a_class_is_told_about_the_brackets() -> None:
    registry = Registry()
    registry.register_agent("class", lambda: ScriptedAgent)  # type: ignore[arg-type, return-value]
    with pytest.raises(PluginError, match="gave the class ScriptedAgent"):
        registry.agent("class")


def test_a_reference_loads_an_agent_out_of_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "agent_beside_me.py").write_text(AGENT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert type(Registry().agent("agent_beside_me:Agent")).__name__ == "Agent"


def test_a_wrong_reference_says_what_is_wrong_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "agent_near_me.py").write_text(AGENT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    registry = Registry()
    with pytest.raises(UnknownNameError, match="Did you mean 'Agent'"):
        registry.agent("agent_near_me:Agnt")
    with pytest.raises(PluginError, match=r"needs the module 'agent_far_away'.*current folder"):
        registry.agent("agent_far_away:Agent")
    with pytest.raises(UnknownNameError, match=r"'folder\.my_agent:Agent'"):
        registry.agent("folder/my_agent.py:Agent")


@pytest.mark.parametrize("half", ["some_module:", ":Agent", ":"])
def test_half_a_reference_is_an_unknown_name(half: str) -> None:
    with pytest.raises(UnknownNameError, match=f"no agent named {half!r}"):
        Registry().agent(half)


def test_a_simulator_is_made_with_the_options_and_may_be_a_reference() -> None:
    registry = Registry()
    registry.register_simulator("fake", FakeSimulator)
    for name in ("fake", "pytest_drive_robust.testing:FakeSimulator"):
        simulator = registry.simulator(name, SimulatorOptions(tick_cap=7))
        assert isinstance(simulator, FakeSimulator)
        assert simulator.options.tick_cap == 7


def test_what_is_no_simulator_is_refused_by_its_missing_members() -> None:
    registry = Registry()
    registry.register_simulator("agent", lambda options: _scripted())  # type: ignore[arg-type, return-value]
    with pytest.raises(PluginError, match=r"lacks close, done, dt_s, .*step"):
        registry.simulator("agent")


def test_a_metric_is_registered_and_found() -> None:
    registry = Registry()
    registry.register_metric("episodes", len)
    assert registry.metric("episodes")([]) == 0
    assert dict(registry.names("metrics"))["DS"] == "built in"
    assert "episodes" in dict(registry.names("metrics"))


def test_a_built_in_metric_keeps_its_meaning() -> None:
    with pytest.raises(UsageError, match="'DS' is a built-in metric"):
        Registry().register_metric("DS", len)


@pytest.mark.parametrize("name", ["my metric", "speed\tp95", "#bumps", "bumps<=3", "share≥half"])
def test_a_metric_that_no_sentence_can_name_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match=r"cannot name a metric: in a requirement.*Call it '\w+', for example"):
        Registry().register_metric(name, len)


@pytest.mark.parametrize("name", ["p95-speed", "ticks", "méan", "a.b", "%late"])
def test_a_metric_of_one_word_may_look_like_anything(name: str) -> None:
    registry = Registry()
    registry.register_metric(name, len)
    assert name in dict(registry.names("metrics"))


def test_a_required_name_is_loaded_but_nothing_is_made_of_it(install: Install) -> None:
    install("unread-agents", "1.0", group="agents", entry="unread", source="raise RuntimeError('imported')")
    registry = Registry()
    registry.register_agent("unmade", lambda: 1 / 0)  # type: ignore[arg-type, return-value]
    registry.require("agents", "unmade")
    with pytest.raises(PluginError, match=r"unread-agents 1\.0 does not load"):
        registry.require("agents", "unread")
    with pytest.raises(UnknownNameError, match="Did you mean 'unread'"):
        registry.require("agents", "unreed")
    with pytest.raises(UnknownNameError, match="no metric named 'some_module:function'"):
        registry.require("metrics", "some_module:function")


@pytest.mark.parametrize("name", ["", "a:b", " padded"])
def test_a_name_that_could_never_be_typed_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="cannot be a name of agents"):
        Registry().register_agent(name, _scripted)


def test_an_object_in_place_of_a_factory_is_refused() -> None:
    with pytest.raises(UsageError, match="expected a class or a function"):
        Registry().register_agent("object", _scripted())  # type: ignore[arg-type]


def test_a_registered_agent_is_listed_with_the_file_of_its_definition() -> None:
    registry = Registry()
    registry.register_agent("partial", functools.partial(_scripted))
    ((_, origin),) = [row for row in registry.names("agents") if row[0] == "partial"]
    assert origin.endswith("test_registry.py:_scripted")


def test_the_builtins_are_there() -> None:
    registry = Registry()
    assert ("embedded", "built in") in registry.names("simulators")
    assert ("burst-frame-drop", "built in") in registry.names("perturbations")
    assert registry.perturbations()["inference-latency"].__name__ == "InferenceLatency"
    assert registry.problems() == ()


def test_the_registry_of_the_process_is_one() -> None:
    assert default_registry() is default_registry()


def _of_speed(speed_mps: float) -> ScriptedAgent:
    return ScriptedAgent([Control(throttle=speed_mps / 10.0)])


def _scripted() -> ScriptedAgent:
    return ScriptedAgent([Control()])


def _other_scripted() -> ScriptedAgent:
    return ScriptedAgent([Control(brake=1.0)])


# Simulators that come in several kinds: `gymnasium:ID`.


@pytest.fixture
def several_kinds():
    registry = Registry()
    registry.register_simulator("towns", town, argument="TOWN")
    registry.register_simulator("plain", FakeSimulator)
    return registry


def town(options, name):
    if name == "Atlantis":
        raise UsageError("Atlantis is under water.")
    simulator = FakeSimulator(options)
    simulator.name = f"towns:{name}"
    return simulator


def test_what_follows_the_colon_is_passed_to_the_factory(several_kinds):
    assert several_kinds.simulator("towns:Rome").name == "towns:Rome"
    assert several_kinds.simulator("towns:a:b").name == "towns:a:b"
    assert several_kinds.simulator("towns").name == "towns:"
    assert several_kinds.simulator("plain").name == "fake"


def test_the_list_shows_the_syntax(several_kinds):
    names = [name for name, _ in several_kinds.names("simulators")]
    assert names == ["bench2drive", "embedded", "gymnasium:ID", "plain", "towns:TOWN"]


def test_the_factory_s_own_refusal_comes_through(several_kinds):
    with pytest.raises(UsageError, match=r"^Atlantis is under water\.$"):
        several_kinds.simulator("towns:Atlantis")


def test_a_misspelt_name_before_the_colon_gets_the_nearest_one(several_kinds):
    with pytest.raises(UnknownNameError, match="Did you mean 'gymnasium:merge-v0'"):
        several_kinds.simulator("gymnasum:merge-v0")
    with pytest.raises(UnknownNameError, match="Did you mean 'towns:Rome'"):
        several_kinds.require("simulators", "twons:Rome")


def test_a_module_of_your_own_is_still_a_module(several_kinds, tmp_path, monkeypatch):
    (tmp_path / "town.py").write_text("from pytest_drive_robust.testing import FakeSimulator as Sim\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert several_kinds.simulator("town:Sim").name == "fake"
    with pytest.raises(PluginError, match="no_module_at_all"):
        several_kinds.simulator("no_module_at_all:Sim")


def test_a_module_in_the_current_folder_is_no_misspelt_name(several_kinds, tmp_path, monkeypatch):
    (tmp_path / "town_beside.py").write_text("from pytest_drive_robust.testing import FakeSimulator as Sim\n")
    several_kinds.register_simulator("town_besides", town, argument="TOWN")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if folder])
    assert several_kinds.simulator("town_beside:Sim").name == "fake"


def test_a_module_of_a_package_is_no_misspelt_name(several_kinds):
    several_kinds.register_simulator("my.towns", town, argument="TOWN")
    with pytest.raises(PluginError, match=r"the simulator 'my\.town:Sim' needs the module 'my', which is neither"):
        several_kinds.simulator("my.town:Sim")


def test_what_follows_the_colon_makes_the_factory_of_an_agent_whose_refusal_comes_through():
    def recorded(name):
        if not name:
            raise UsageError("replayed:FILE needs a file.")
        return lambda: ScriptedAgent([Control(throttle=float(name))])

    registry = Registry()
    registry.register_agent("replayed", recorded, argument="FILE")
    assert "replayed:FILE" in dict(registry.names("agents"))
    assert registry.agent("replayed:0.5").act(None) == Control(throttle=0.5)
    for ask in (registry.agent, lambda name: registry.require("agents", name)):
        with pytest.raises(UsageError, match=r"^replayed:FILE needs a file\.$"):
            ask("replayed")


def test_a_name_of_one_kind_is_none_of_another():
    registry = Registry()
    registry.register_agent("mine", _scripted)
    assert "mine" not in dict(registry.names("simulators"))
    with pytest.raises(UnknownNameError, match="no simulator named 'mine'"):
        registry.simulator("mine")


def test_names_of_a_session_inside_another_are_forgotten_and_those_around_it_come_back():
    kept = hide_names()
    try:
        outer = default_registry()
        outer.register_agent("mine", _scripted)
        inside = hide_names()
        assert "mine" not in dict(default_registry().names("agents"))
        forget_names(inside)
        assert default_registry() is outer
    finally:
        forget_names(kept)
    assert default_registry() is not outer


def test_names_without_an_argument_take_none(several_kinds):
    with pytest.raises(UsageError, match=r"the simulator 'plain' takes nothing after a colon, but was given 'Rome'"):
        several_kinds.simulator("plain:Rome")


def test_an_agent_is_given_options_by_name(several_kinds):
    several_kinds.register_agent("plain", _scripted)
    with pytest.raises(UsageError, match="the agent 'plain' has no option '8': give options as plain:NAME=VALUE"):
        several_kinds.agent("plain:8")


def failure(phrase: str) -> type[Perturbation]:
    """Return a new class of that sentence, with one severity."""
    return dataclass(
        type("Dimmed", (Perturbation,), {"__annotations__": {"gain": float}, "gain": 0.5, "phrase": phrase})
    )


@pytest.mark.parametrize(
    ("phrase", "message"),
    [
        ("{gain} ms latency", "is a sentence of Dimmed and of InferenceLatency"),
        ("dimmed {gain} to {gain}", "shows 'gain'.*each once: gain"),
        ("dimmed {gain:.2f}", "shows 'gain'.*plain names"),
        ("dimmed {level}", "shows 'level'.*each once: gain"),
        ("dimmed {gain", "is malformed"),
        ("camera #{gain} off", "can stand in no requirement: expected one line"),
        ("dimmed <= {gain}", "without '#', '<=' and '>='"),
        ("dimmed >= {gain}", "can stand in no requirement"),
        ("dimmed ≤ {gain}", "can stand in no requirement"),
        ("dimmed ≥ {gain}", "can stand in no requirement"),
        ("dimmed\n{gain}", "can stand in no requirement"),
        ("Clean", "that is not 'clean'"),
    ],
)
def test_a_sentence_that_cannot_be_read_back_is_refused_where_it_is_registered(phrase: str, message: str) -> None:
    with pytest.raises(PluginError, match=rf"perturbation 'dimmed' from .* cannot be used: .*{message}"):
        Registry().register_perturbation(failure(phrase))


def test_a_phrase_that_would_be_read_out_of_the_sentence_of_another_failure_is_refused() -> None:
    body = {"__annotations__": {"kind": str}, "kind": "red", "phrase": "{kind} ms latency"}
    with pytest.raises(PluginError, match="'200 ms latency' is a sentence of Tinted and of InferenceLatency"):
        Registry().register_perturbation(dataclass(type("Tinted", (Perturbation,), body)))


def test_a_phrase_that_became_a_severity_is_refused_where_it_is_registered() -> None:
    body = {"__annotations__": {"gain": float, "phrase": str}, "gain": 0.5, "phrase": "dimmed {gain}"}
    with pytest.raises(PluginError, match=r"'dimmed' from .* cannot be used: Dimmed has 'phrase' as a severity"):
        Registry().register_perturbation(dataclass(type("Dimmed", (Perturbation,), body)))


def test_the_name_of_a_built_in_failure_or_world_keeps_its_meaning() -> None:
    with pytest.raises(UsageError, match="'gps-noise' is a built-in perturbation and keeps its meaning"):
        Registry().register_perturbation(failure("dimmed {gain}"), "gps-noise")
    with pytest.raises(UsageError, match="'embedded' is a built-in simulator and keeps its meaning"):
        Registry().register_simulator("embedded", FakeSimulator)
    Registry().register_perturbation(GpsNoise)  # the same again says nothing new


def test_an_agent_that_nothing_can_make_is_refused_before_anything_is_driven(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "numbered.py").write_text("number = 3\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(PluginError, match=r"'numbered:number' from .* is 3, expected a class or a function"):
        Registry().require("agents", "numbered:number")


def test_two_failures_of_one_sentence_are_both_left_out_with_their_origins(install: Install) -> None:
    source = (
        "from dataclasses import dataclass\nfrom pytest_drive_robust import Perturbation\n"
        "@dataclass\nclass Entry(Perturbation):\n    gain: float = 0.5\n    phrase = 'dimmed {gain}'\n"
    )
    install("dims", "1.0", group="perturbations", entry="dim", source=source)
    registry = Registry()
    registry.register_perturbation(failure("dimmed {gain}"))
    registry.register_perturbation(NoisyWheel)
    assert not {"dim", "dimmed"} & registry.perturbations().keys()
    assert "noisy-wheel" in registry.perturbations()
    (problem,) = registry.problems()
    assert "'dim' from dims 1.0 and 'dimmed' from" in str(problem)
    assert "'dimmed 0.5' is a sentence of Entry and of Dimmed" in str(problem)


def test_one_failure_by_two_names_and_one_that_replaces_another_are_told_apart(install: Install) -> None:
    install("dims", "1.0", group="perturbations", entry="dimmed", source="1 / 0")
    registry = Registry()
    dimmed = failure("dimmed {gain}")
    registry.register_perturbation(dimmed)
    registry.register_perturbation(dimmed, "also-dimmed")
    assert {"dimmed", "also-dimmed"} <= registry.perturbations().keys()
    assert registry.problems() == ()


def test_severities_of_a_class_that_nobody_made_a_dataclass_are_refused_with_what_to_write() -> None:
    for body in (
        {"__annotations__": {"gain": float}, "gain": 0.5, "phrase": "dimmed {gain}"},
        {"__annotations__": {"gain": float}, "phrase": "dimmed {gain}"},
        {"__annotations__": {"gain": "float"}, "gain": 0.5},
    ):
        with pytest.raises(PluginError, match=r"has 'gain', but is no dataclass.*write @dataclass above the class"):
            Registry().register_perturbation(type("Dimmed", (Perturbation,), body))


def test_what_is_no_severity_needs_no_dataclass() -> None:
    body = {"__annotations__": {"table": "ClassVar[int]", "_seen": int, "phrase": str}, "table": 3, "_seen": 0}
    Registry().register_perturbation(type("Dimmed", (Perturbation,), {**body, "phrase": "dimmed"}))


def test_an_object_in_place_of_a_perturbation_is_refused() -> None:
    with pytest.raises(
        PluginError, match=r"NoisyWheel.* is not a perturbation: .*subclass of Perturbation, without br"
    ):
        Registry().register_perturbation(NoisyWheel())  # type: ignore[arg-type]


def test_an_entry_point_of_a_built_in_name_is_told_what_can_be_done_about_it(install: Install) -> None:
    install("bold-worlds", "1.0", group="simulators", entry="embedded", source="class Entry: pass")
    with pytest.raises(PluginError, match=r"built in and bold-worlds 1\.0\. The built-in one keeps the name"):
        Registry().simulator("embedded")


@pytest.mark.parametrize(
    ("entry", "message"),
    [("DS", "'DS' is a built-in metric and keeps its meaning"), ("top speed", "Call it 'top_speed', say")],
)
def test_a_metric_of_an_entry_point_that_no_sentence_reaches_is_told(
    install: Install, entry: str, message: str
) -> None:
    install("speeds", "1.0", group="metrics", entry=entry, source="def Entry(results): return 1.0")
    (problem,) = Registry().problems()
    assert str(problem).startswith(f"the metric {entry!r} from speeds 1.0 cannot be used: ")
    assert message in str(problem)


def test_an_entry_point_group_that_is_misspelt_is_told_where_its_name_is_missed(install: Install) -> None:
    install("lost-agents", "1.0", group="agent", entry="lost", source=AGENT)
    told = r"'lost' from lost-agents 1\.0 is in an unknown entry point group, 'pytest_drive_robust\.agent'\. "
    with pytest.raises(UnknownNameError, match=told + r"Did you mean 'pytest_drive_robust\.agents'\?"):
        Registry().agent("lost")
    (problem,) = Registry().problems()
    assert "lost-agents 1.0" in str(problem)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"ladder": ("gian", (0.9, 0.5))}, r"the ladder of Dimmed is \('gian', \(0\.9, 0\.5\)\), expected .*\(gain\)"),
        ({"ladder": ["gain", 0.9, 0.5]}, "the ladder of Dimmed is .*, expected one of its fields"),
        ({"ladder": ("gain", ())}, "the ladder of Dimmed is .*values from mild to severe"),
        ({"ladder": ("gain", "low high")}, "the ladder of Dimmed is .*values from mild to severe"),
        ({"variants": {"dark": {"gian": 0.1}}}, "'variants' of Dimmed names 'gian', .* Did you mean 'gain'"),
        ({"readings": {"released": {"gian": 0.1}}}, "'readings' of Dimmed names 'gian'"),
        ({"example": {"gian": 0.1}}, "'example' of Dimmed names 'gian'"),
        ({"variants": ["dark"]}, "cannot be used: AttributeError: 'list' object has no attribute"),
    ],
)
def test_what_a_failure_says_of_itself_is_checked_where_it_is_registered(said: dict[str, object], message: str) -> None:
    body = {"__annotations__": {"gain": float}, "gain": 0.5, "phrase": "dimmed {gain}", **said}
    with pytest.raises(PluginError, match=message):
        Registry().register_perturbation(dataclass(type("Dimmed", (Perturbation,), body)))


def test_a_ladder_of_ticks_and_one_beside_a_field_without_a_default_are_taken() -> None:
    body = {
        "__annotations__": {"place": str, "late_ms": float},
        "phrase": "{late_ms} ms late",
        "ladder": ("late_ms", "ticks"),
    }
    Registry().register_perturbation(dataclass(type("Late", (Perturbation,), body)))
