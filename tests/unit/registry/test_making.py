"""What a factory may return, and how a factory that breaks is named."""

from __future__ import annotations

from pathlib import Path

import pytest
from registry_samples import scripted

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PluginError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import ScriptedAgent


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
            other = scripted()
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


def test_a_factory_that_gives_a_class_is_told_about_the_brackets() -> None:
    registry = Registry()
    registry.register_agent("class", lambda: ScriptedAgent)  # type: ignore[arg-type, return-value]
    with pytest.raises(PluginError, match="gave the class ScriptedAgent"):
        registry.agent("class")


def test_what_is_no_simulator_is_refused_by_its_missing_members() -> None:
    registry = Registry()
    registry.register_simulator("agent", lambda options: scripted())  # type: ignore[arg-type, return-value]
    with pytest.raises(PluginError, match=r"lacks close, done, dt_s, .*step"):
        registry.simulator("agent")


def test_an_agent_that_nothing_can_make_is_refused_before_anything_is_driven(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "numbered.py").write_text("number = 3\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(PluginError, match=r"'numbered:number' from .* is 3, expected a class or a function"):
        Registry().require("agents", "numbered:number")
