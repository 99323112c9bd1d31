"""Names of several worlds or agents, with an argument after a colon: `gymnasium:ID`."""

from __future__ import annotations

import sys

import pytest
from registry_samples import scripted

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent


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


def test_names_without_an_argument_take_none(several_kinds):
    with pytest.raises(UsageError, match=r"the simulator 'plain' takes nothing after a colon, but was given 'Rome'"):
        several_kinds.simulator("plain:Rome")


def test_an_agent_is_given_options_by_name(several_kinds):
    several_kinds.register_agent("plain", scripted)
    with pytest.raises(UsageError, match="the agent 'plain' has no option '8': give options as plain:NAME=VALUE"):
        several_kinds.agent("plain:8")
