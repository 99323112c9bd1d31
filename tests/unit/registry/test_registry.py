"""Names, origins, and what happens when somebody else's entry is broken."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from registry_samples import AGENT, Install, NoisyWheel, scripted

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError
from pytest_drive_robust.perturbations import GpsNoise
from pytest_drive_robust.registry.registry import Registry, default_registry, forget_names, hide_names
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent


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
    registry.register_agent("mine", scripted)
    assert isinstance(registry.agent("mine"), ScriptedAgent)


def test_a_name_registered_by_two_definitions_is_an_error_that_names_both() -> None:
    registry = Registry()
    registry.register_agent("mine", scripted)
    with pytest.raises(UsageError, match=r"registered twice: by .*scripted and by .*_other_scripted"):
        registry.register_agent("mine", _other_scripted)


def test_one_factory_with_other_options_is_not_registered_under_the_same_name() -> None:
    registry = Registry()
    slow, fast = (functools.partial(_of_speed, speed_mps=speed_mps) for speed_mps in (2.0, 8.0))
    registry.register_agent("driver", slow)
    registry.register_agent("driver", functools.partial(_of_speed, speed_mps=2.0))
    with pytest.raises(UsageError, match=r"registered twice: by .*_of_speed with \{'speed_mps': 2.0\} and with"):
        registry.register_agent("driver", fast)


def _driver_of(speed_mps: float) -> Callable[[], ScriptedAgent]:
    def driver() -> ScriptedAgent:
        return _of_speed(speed_mps)

    return driver


@dataclass
class _Driver:
    speed_mps: float

    def __call__(self) -> ScriptedAgent:
        return _of_speed(self.speed_mps)


@pytest.mark.parametrize("of_speed", [_driver_of, _Driver, lambda speed_mps: lambda speed=speed_mps: _of_speed(speed)])
def test_one_definition_that_was_made_with_other_values_is_not_registered_under_the_same_name(
    of_speed: Callable[[float], Callable[[], ScriptedAgent]],
) -> None:
    registry = Registry()
    registry.register_agent("driver", of_speed(2.0))
    registry.register_agent("driver", of_speed(2.0))
    with pytest.raises(UsageError, match=r"'driver' of agents is registered twice: .* with \{'\w+': 2.0\} and with"):
        registry.register_agent("driver", of_speed(8.0))


def test_the_same_definition_may_register_again_as_when_a_conftest_is_imported_twice() -> None:
    registry = Registry()
    registry.register_perturbation(NoisyWheel)
    registry.register_perturbation(NoisyWheel)
    assert registry.perturbation("noisy-wheel") is NoisyWheel


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


def test_a_reference_loads_an_agent_out_of_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "agent_beside_me.py").write_text(AGENT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert type(Registry().agent("agent_beside_me:Agent")).__name__ == "Agent"


def test_a_simulator_is_made_with_the_options_and_may_be_a_reference() -> None:
    registry = Registry()
    registry.register_simulator("fake", FakeSimulator)
    for name in ("fake", "pytest_drive_robust.testing:FakeSimulator"):
        simulator = registry.simulator(name, SimulatorOptions(tick_cap=7))
        assert isinstance(simulator, FakeSimulator)
        assert simulator.options.tick_cap == 7


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
        Registry().register_agent(name, scripted)


def test_an_object_in_place_of_a_factory_is_refused() -> None:
    with pytest.raises(UsageError, match="expected a class or a function"):
        Registry().register_agent("object", scripted())  # type: ignore[arg-type]


def test_a_registered_agent_is_listed_with_the_file_of_its_definition() -> None:
    registry = Registry()
    registry.register_agent("partial", functools.partial(scripted))
    ((_, origin),) = [row for row in registry.names("agents") if row[0] == "partial"]
    assert origin.endswith("registry_samples.py:scripted")


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


def _other_scripted() -> ScriptedAgent:
    return ScriptedAgent([Control(brake=1.0)])


def test_names_of_a_session_inside_another_are_forgotten_and_those_around_it_come_back():
    kept = hide_names()
    try:
        outer = default_registry()
        outer.register_agent("mine", scripted)
        inside = hide_names()
        assert "mine" not in dict(default_registry().names("agents"))
        forget_names(inside)
        assert default_registry() is outer
    finally:
        forget_names(kept)
    assert default_registry() is not outer


def test_the_name_of_a_built_in_failure_or_world_keeps_its_meaning() -> None:
    with pytest.raises(UsageError, match="'gps-noise' is a built-in perturbation and keeps its meaning"):
        Registry().register_perturbation(NoisyWheel, "gps-noise")
    with pytest.raises(UsageError, match="'embedded' is a built-in simulator and keeps its meaning"):
        Registry().register_simulator("embedded", FakeSimulator)
    Registry().register_perturbation(GpsNoise)  # the same again says nothing new


def test_an_entry_point_of_a_built_in_name_is_told_what_can_be_done_about_it(install: Install) -> None:
    install("bold-worlds", "1.0", group="simulators", entry="embedded", source="class Entry: pass")
    with pytest.raises(PluginError, match=r"built in and bold-worlds 1\.0\. The built-in one keeps the name"):
        Registry().simulator("embedded")


@pytest.mark.parametrize(
    ("entry", "message"),
    [("DS", "'DS' is a built-in metric and keeps its meaning"), ("top speed", "Call it 'top_speed', for example")],
)
def test_a_metric_of_an_entry_point_that_no_sentence_reaches_is_told(
    install: Install, entry: str, message: str
) -> None:
    install("speeds", "1.0", group="metrics", entry=entry, source="def Entry(results): return 1.0")
    (problem,) = Registry().problems()
    assert str(problem).startswith(f"the metric {entry!r} from speeds 1.0 cannot be used: ")
    assert message in str(problem)
