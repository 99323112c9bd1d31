"""Errors for names that no entry has."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from registry_samples import AGENT, Install, scripted

from pytest_drive_robust.errors import PluginError, UnknownNameError
from pytest_drive_robust.registry.registry import Registry


def test_an_unknown_name_is_answered_with_the_nearest_one_and_how_to_register() -> None:
    registry = Registry()
    registry.register_agent("expert-driver", scripted)
    with pytest.raises(UnknownNameError, match=r"Did you mean 'expert-driver'\?.*module:Class"):
        registry.agent("expert-drivr")
    with pytest.raises(UnknownNameError, match="Did you mean 'gps-noise'"):
        registry.perturbation("gps-nose")
    with pytest.raises(UnknownNameError, match="Did you mean 'agents'"):
        registry.names("agent")


def test_of_many_names_the_nearest_are_listed_and_what_lists_the_others() -> None:
    registry = Registry()
    for name in (*"abcdefghijk", "speedster"):
        registry.register_agent(name, scripted)
    with pytest.raises(UnknownNameError, match=r"Nearest of \d+: speedster, .*`drive-robust list agents` lists all\."):
        registry.agent("speedstr")


def test_where_nothing_has_a_name_the_message_says_so() -> None:
    assert str(UnknownNameError.of("stored run", "befor", [], hint="Store one.")) == (
        "there is no stored run named 'befor', nor any other. Store one."
    )


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


def test_a_name_of_one_kind_is_none_of_another():
    registry = Registry()
    registry.register_agent("mine", scripted)
    assert "mine" not in dict(registry.names("simulators"))
    with pytest.raises(UnknownNameError, match="no simulator named 'mine'"):
        registry.simulator("mine")


def test_an_entry_point_group_that_is_misspelt_is_told_where_its_name_is_missed(install: Install) -> None:
    install("lost-agents", "1.0", group="agent", entry="lost", source=AGENT)
    told = r"'lost' from lost-agents 1\.0 is in an unknown entry point group, 'pytest_drive_robust\.agent'\. "
    with pytest.raises(UnknownNameError, match=told + r"Did you mean 'pytest_drive_robust\.agents'\?"):
        Registry().agent("lost")
    (problem,) = Registry().problems()
    assert "lost-agents 1.0" in str(problem)
