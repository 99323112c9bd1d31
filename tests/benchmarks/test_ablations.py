"""`benchmarks/ablations.py`: one factor of a wrapper changes, and what is said of it is what was driven."""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from typing import Any

import ablations
import numpy as np
import pytest
from _variants import VARIANTS, Variant

from drive_robust_agents._nets.inference import LoadedNetwork
from drive_robust_agents._wrappers import tuning
from drive_robust_agents._wrappers.bev_agent import CAMERAS
from drive_robust_agents.tcp import CAMERAS as TCP_CAMERAS
from drive_robust_agents.vad import VAD
from pytest_drive_robust import Control, GlobalPlan, Observation, RoadOption
from pytest_drive_robust.domain.observation import Compass, Gps, Image, Imu, Speed
from pytest_drive_robust.domain.route import PlanPoint
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.identity import agent_identity

NAMES = [(agent, name) for agent, (_, changes) in VARIANTS.items() for name in changes]


@pytest.mark.parametrize(("agent", "name"), NAMES)
def test_each_change_is_in_force_after_every_reset(agent: str, name: str, monkeypatch) -> None:
    monkeypatch.setattr(LoadedNetwork, "of", lambda *_, **__: None)  # no network is asked here
    change = VARIANTS[agent][1][name]
    driven = Variant(agent, name)()
    for _ in range(2):
        driven.reset(GlobalPlan(()), 0)
        for number, value in change.numbers.items():
            assert getattr(driven._controller.tuning, number) == value
    for option, value in change.options.items():
        assert getattr(driven, option) == value
    asked = Control(throttle=0.6, steer=0.3)
    plain = VARIANTS[agent][0](**change.options)._for_driven_car(asked, 4.0)
    given = driven._for_driven_car(asked, 4.0)
    assert given.steer == (asked.steer if change.steers_as_it_is else plain.steer)
    assert given.throttle == (asked.throttle if change.pedals_as_they_are else plain.throttle)


class Asked:
    """A network that writes down what it was asked and plans to stand."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def run(self, method: str = "forward", /, **inputs: Any) -> dict[str, Any]:
        shown = {"motion", "can_bus", "known"}
        self.rows.append({name: values[0].tolist() for name, values in inputs.items() if name in shown})
        remembered = {name: np.zeros((1, *shape), dtype=np.float32) for name, shape in VAD.remembers.items()}
        return {"waypoints": np.zeros((1, 6, 2), dtype=np.float32), **remembered}


def test_the_memory_can_be_moved_by_the_speedometer_in_place_of_a_gps_that_jumps_or_left_out(monkeypatch) -> None:
    rows = {}
    for change in ("as-shipped", "memory-by-speedometer", "no-memory"):
        network = Asked()
        monkeypatch.setattr(LoadedNetwork, "of", lambda *_, network=network, **__: network)
        agent = Variant("vad", change)()
        agent.reset(GlobalPlan(tuple(PlanPoint(x_m, 0.0, RoadOption.LANE_FOLLOW) for x_m in (0.0, 99.0))), 0)
        picture = np.zeros((96, 160, 3), dtype=np.uint8)
        for tick, x_m in ((0, 0.0), (10, 14.0)):
            sensed = (Gps(x_m, 3.0, tick), Compass(math.pi / 2.0, tick), Imu(0.0, 0.0, 0.0, tick), Speed(4.0, tick))
            agent.act(Observation(tick, *sensed, {camera.name: Image(picture, tick) for camera in CAMERAS}))
        rows[change] = network.rows
    assert rows["as-shipped"][0] == rows["memory-by-speedometer"][0]  # nothing is remembered in the first tick
    assert rows["as-shipped"][0] == rows["no-memory"][0]
    assert [rows[change][1]["known"] for change in rows] == [1.0, 1.0, 0.0]
    assert [rows[change][1]["motion"][0] for change in rows] == [14.0, 2.0, 0.0]
    assert [rows[change][1]["can_bus"][4] for change in rows] == [14.0, 2.0, 0.0]


def test_a_place_behind_moves_what_the_agent_aims_at_and_nothing_else(monkeypatch) -> None:
    monkeypatch.setattr(LoadedNetwork, "of", lambda *_, **__: None)
    rows, pictures = [], {camera.name: Image(np.zeros((96, 160, 3), np.uint8), 0) for camera in TCP_CAMERAS}
    for change in ("as-shipped", "place-20-m-behind"):
        agent = Variant("tcp", change)()
        agent.reset(GlobalPlan(tuple(PlanPoint(0.0, y_m, RoadOption.LANE_FOLLOW) for y_m in (0.0, 99.0))), 0)
        sensed = (Gps(0.0, 30.0, 0), Compass(math.pi, 0), Imu(0.0, 0.0, 0.0, 0), Speed(4.0, 0))
        rows.append(agent._prepare(Observation(0, *sensed, pictures)))
    assert [row.inputs.pop("target").round(3).tolist() for row in rows] == [[69.0, 0.0], [89.0, 0.0]]
    assert str(rows[0].inputs) == str(rows[1].inputs)


@pytest.mark.parametrize(("agent", "plans"), [("tcp", {"waypoints": 4}), ("simlingo", {"path": 20, "waypoints": 10})])
def test_a_plan_is_turned_to_the_target_and_keeps_its_lengths(agent: str, plans: dict[str, int], monkeypatch) -> None:
    monkeypatch.setattr(LoadedNetwork, "of", lambda *_, **__: None)
    straight = {name: np.array([[k + 1.0, 0.0] for k in range(count)], np.float32) for name, count in plans.items()}
    target = (10.0, 10.0)  # 45 degrees to the right
    for change, degrees in (("as-shipped", 0.0), ("half-to-the-target", 22.5), ("straight-to-the-target", 45.0)):
        driven = Variant(agent, change)()
        driven.reset(GlobalPlan(()), 0)
        sensed = (Gps(0.0, 0.0, 0), Compass(0.0, 0), Imu(0.0, 0.0, 0.0, 0), Speed(4.0, 0))
        driven._control(Observation(0, *sensed, {}), (target, target), straight)
        for plan in (driven.plan().path, driven.plan().speed_points):
            assert len(plan) in plans.values()
            for k, (ahead, right) in enumerate(plan):
                assert math.isclose(math.degrees(math.atan2(right, ahead)), degrees, abs_tol=1e-4)
                assert math.isclose(math.hypot(ahead, right), k + 1.0, abs_tol=1e-4)


@pytest.mark.parametrize("agent", ["tcp", "uniad", "vad"])
def test_a_target_behind_on_the_left_is_steered_for_to_the_right_unless_the_angle_is_wrapped(
    agent: str, monkeypatch
) -> None:
    monkeypatch.setattr(LoadedNetwork, "of", lambda *_, **__: None)
    straight, behind_on_the_left, steered = [(k + 1.0, 0.0) for k in range(6)], (-5.0, -5.0), {}
    for change in ("as-shipped", "angle-wrapped"):
        driven = Variant(agent, change)()
        driven.reset(GlobalPlan(()), 0)
        steered[change] = driven._controller.step(straight, 4.0, behind_on_the_left).steer
    assert steered["as-shipped"] > 0.5
    assert steered["angle-wrapped"] < -0.5


def test_two_changes_never_share_an_episode_and_the_published_numbers_are_the_published_ones() -> None:
    written = [(agent, repr(Variant(agent, name).configuration)) for agent, name in NAMES]
    assert len(set(written)) == len(written)
    rule = VARIANTS["tcp"][1]["ours-but-target-rule"].numbers
    assert {name: getattr(tuning.TCP_PUBLISHED, name) for name in rule} == dict(rule)
    pedals = VARIANTS["tcp"][1]["ours-but-pedals"].numbers
    assert {name: getattr(tuning.TCP_PUBLISHED, name) for name in pedals} == dict(pedals)


def test_a_change_that_does_something_else_since_is_driven_again(tmp_path, monkeypatch) -> None:
    text = Path(ablations._variants.__file__).read_text()
    (tmp_path / "edited_variants.py").write_text(text.replace("observation.speed.mps * 0.05", "observation.speed.mps"))
    monkeypatch.syspath_prepend(tmp_path)
    keys = set()
    for module in (ablations._variants, importlib.import_module("edited_variants")):
        registry = Registry()
        module.pytest_drive_robust_register(registry)
        keys.add(agent_identity("variant:vad/memory-by-speedometer", registry))
    assert len(keys) == 2


def test_an_unknown_change_is_refused_with_those_that_there_are() -> None:
    registry = Registry()
    ablations._variants.pytest_drive_robust_register(registry)
    with pytest.raises(UnknownNameError, match="target-rule"):
        registry.agent("variant:vad/ours-but-target-rules")


def test_less_by_is_paired_by_route() -> None:
    clean = [100.0, 80.0, 60.0, 90.0]
    value, low, high = ablations.less_by((clean, [50.0, 40.0, 30.0, 45.0]), (clean, [60.0, 48.0, 36.0, 54.0]))
    assert math.isclose(value, 0.1)
    assert math.isclose(low, high, abs_tol=1e-9)  # every route gained the same share: nothing is uncertain


@pytest.mark.slow
def test_the_table_and_the_picture_show_what_was_driven(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["tcp", "--routes", "3101,2401", "--settings", "GPS noise 15 m"]
    words += ["--base", "our-numbers", "--changes", "ours-but-steering"]
    ablations.main([*words, "--workers", "1", "--store", "store", "--write", "drawn"])
    told = capsys.readouterr().out
    first, second = (line.split(" | ") for line in told.splitlines() if line.startswith("| GPS noise 15 m"))
    assert (first[1], second[1]) == ("our-numbers", "ours-but-steering")
    for row in (first, second):
        assert math.isclose(float(row[5]), 1.0 - float(row[3]) / float(row[2]), abs_tol=0.01)
    assert (tmp_path / "drawn" / "tcp.md").read_text() in told
    assert "over 2 routes" in (tmp_path / "drawn" / "tcp.svg").read_text()
