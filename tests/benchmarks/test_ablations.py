"""`benchmarks/ablations.py`: one factor of a wrapper changes, and what is said of it is what was driven."""

from __future__ import annotations

import math

import ablations
import pytest
from _variants import VARIANTS, Variant

from drive_robust_agents._nets.inference import Policy
from drive_robust_agents._wrappers import tuning
from pytest_drive_robust import Control, GlobalPlan
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.registry.registry import Registry

NAMES = [(agent, name) for agent, (_, changes) in VARIANTS.items() for name in changes]


@pytest.mark.parametrize(("agent", "name"), NAMES)
def test_each_change_is_in_force_after_every_reset(agent: str, name: str, monkeypatch) -> None:
    monkeypatch.setattr(Policy, "of", lambda *_, **__: None)  # no network is asked here
    change = VARIANTS[agent][1][name]
    driven = Variant(agent, name)()
    for _ in range(2):
        driven.reset(GlobalPlan(()), 0)
        for number, value in change.numbers.items():
            assert getattr(driven._controller.tuning, number) == value
    for option, value in change.options.items():
        assert getattr(driven, option) == value
    asked = Control(throttle=0.6, steer=0.3)
    plain = VARIANTS[agent][0](**change.options)._given(asked, 4.0)
    given = driven._given(asked, 4.0)
    assert given.steer == (asked.steer if change.steers_as_it_is else plain.steer)
    assert given.throttle == (asked.throttle if change.pedals_as_they_are else plain.throttle)


def test_two_changes_never_share_an_episode_and_the_published_numbers_are_the_published_ones() -> None:
    written = [(agent, repr(Variant(agent, name).configuration)) for agent, name in NAMES]
    assert len(set(written)) == len(written)
    rule = VARIANTS["tcp"][1]["ours-but-target-rule"].numbers
    assert {name: getattr(tuning.TCP_PUBLISHED, name) for name in rule} == dict(rule)
    pedals = VARIANTS["tcp"][1]["ours-but-pedals"].numbers
    assert {name: getattr(tuning.TCP_PUBLISHED, name) for name in pedals} == dict(pedals)


def test_an_unknown_change_is_refused_with_those_that_there_are() -> None:
    registry = Registry()
    ablations._variants.pytest_drive_robust_register(registry)
    with pytest.raises(UnknownNameError, match="target-rule"):
        registry.agent("variant:vad/target-rules")


def test_less_by_is_paired_by_route() -> None:
    clean = [100.0, 80.0, 60.0, 90.0]
    value, low, high = ablations.less_by((clean, [50.0, 40.0, 30.0, 45.0]), (clean, [60.0, 48.0, 36.0, 54.0]))
    assert math.isclose(value, 0.1)
    assert math.isclose(low, high, abs_tol=1e-9)  # every route gained the same share: nothing is uncertain


@pytest.mark.slow
def test_the_table_and_the_picture_show_what_was_driven(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["tcp", "--routes", "3101,2401", "--changes", "ours-but-steering", "--settings", "GPS noise 15 m"]
    ablations.main([*words, "--workers", "1", "--store", "store", "--write", "drawn"])
    told = capsys.readouterr().out
    first, second = (line.split(" | ") for line in told.splitlines() if line.startswith("| GPS noise 15 m"))
    assert (first[1], second[1]) == ("as-shipped", "ours-but-steering")
    for row in (first, second):
        assert math.isclose(float(row[5]), 1.0 - float(row[3]) / float(row[2]), abs_tol=0.01)
    assert (tmp_path / "drawn" / "tcp.md").read_text() in told
    assert "over 2 routes" in (tmp_path / "drawn" / "tcp.svg").read_text()
