"""Simulators that come in several kinds: `gymnasium:ID`."""

from __future__ import annotations

import pytest

from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import FakeSimulator


@pytest.fixture
def registry():
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


def test_what_follows_the_colon_is_passed_to_the_factory(registry):
    assert registry.simulator("towns:Rome").name == "towns:Rome"
    assert registry.simulator("towns:a:b").name == "towns:a:b"
    assert registry.simulator("towns").name == "towns:"
    assert registry.simulator("plain").name == "fake"


def test_the_list_shows_the_syntax(registry):
    names = [name for name, _ in registry.names("simulators")]
    assert names == ["embedded", "gymnasium:ID", "plain", "towns:TOWN"]


def test_the_factory_s_own_refusal_comes_through(registry):
    with pytest.raises(UsageError, match=r"^Atlantis is under water\.$"):
        registry.simulator("towns:Atlantis")


def test_a_misspelt_name_before_the_colon_gets_the_nearest_one(registry):
    with pytest.raises(UnknownNameError, match="Did you mean 'gymnasium:merge-v0'"):
        registry.simulator("gymnasum:merge-v0")
    with pytest.raises(UnknownNameError, match="Did you mean 'towns:Rome'"):
        registry.require("simulators", "twons:Rome")


def test_a_module_of_your_own_is_still_a_module(registry, tmp_path, monkeypatch):
    (tmp_path / "town.py").write_text("from pytest_drive_robust.testing import FakeSimulator as Sim\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert registry.simulator("town:Sim").name == "fake"
    with pytest.raises(PluginError, match="no_module_at_all"):
        registry.simulator("no_module_at_all:Sim")


def test_names_without_an_argument_take_none(registry):
    with pytest.raises(PluginError, match="does not load"):
        registry.simulator("plain:Rome")
