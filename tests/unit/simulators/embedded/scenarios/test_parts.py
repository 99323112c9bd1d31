"""Lights in turn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scenario_driver import drawn, drive, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.generate import all_sites
from pytest_drive_robust.simulators.embedded.world import World

FULL_BRAKE = Control(brake=1.0)
RED_FIRST = (
    "CrossingBicycleFlow", "SignalizedJunctionLeftTurn", "SignalizedJunctionLeftTurnEnterFlow",
    "SignalizedJunctionRightTurn", "VanillaSignalizedTurnEncounterRedLight",
)  # fmt: skip


def light_of_ego(world: World) -> int:
    """The stop line on the route."""
    rows = world.dense.rows
    for line in world.lane_map.stop_lines:
        away = np.hypot(rows[:, 0] - line.x_m, rows[:, 1] - line.y_m)
        if away.min() < 1.0 and math.cos(rows[int(away.argmin()), 2] - line.heading_rad) > 0.9:
            return line.index
    raise AssertionError("no light on the route")


def lights_after_trigger(world: World, ticks: int) -> NDArray[np.int64]:
    """Drive until the scenario starts, then stand; return what the lights show, (ticks, lines)."""
    assert drive(world, 20.0, speed_mps=5.0, until=lambda w: bool(w.state.clock[c.STARTED] >= 0))
    seen = []
    for _ in range(ticks):
        world.tick(FULL_BRAKE)
        seen.append(world.state.lights.copy())
    return np.array(seen)


# --- lights ---


@pytest.mark.parametrize("name", RED_FIRST)
def test_the_light_is_red_for_five_seconds_after_the_trigger_then_green(name: str) -> None:
    for number in range(len(all_sites()[name])):
        world = World(drawn(name, number), seed=0)
        line = light_of_ego(world)
        assert world.now().lights[line] == LightState.RED
        seen = lights_after_trigger(world, 160)[:, line]
        assert seen[0] == LightState.RED
        assert int(np.argmax(seen == LightState.GREEN)) == pytest.approx(100, abs=2)
        assert (seen[102:] == LightState.GREEN).all()


def test_the_green_light_turns_red_after_five_seconds_for_five_or_until_another_arm_had_its_green() -> None:
    lasted = []
    for number in range(len(all_sites()["VanillaSignalizedTurnEncounterGreenLight"])):
        world = World(drawn("VanillaSignalizedTurnEncounterGreenLight", number), seed=0)
        line = light_of_ego(world)
        assert world.now().lights[line] == LightState.GREEN
        seen = [LightState(int(state)) for state in lights_after_trigger(world, 600)[:, line]]
        assert seen.index(LightState.YELLOW) == pytest.approx(100, abs=2)
        red = [k for k, state in enumerate(seen) if state is LightState.RED]
        lasted.append(len(red))
        assert red[0] == pytest.approx(140, abs=2)
        assert seen[-1] is LightState.GREEN
    assert set(lasted) <= {100, 400, 401}


@pytest.mark.parametrize(
    "name", ["T_Junction", "VanillaSignalizedTurnEncounterGreenLight", "VanillaSignalizedTurnEncounterRedLight"]
)
def test_roads_that_cross_never_have_green_together(name: str) -> None:
    world = staged(name)
    lines = [line for line in world.lane_map.stop_lines if line.is_light]
    seen = lights_after_trigger(world, 320)
    for one in lines:
        for other in lines:
            if abs(math.cos(one.heading_rad - other.heading_rad)) < 0.1:
                together = (seen[:, one.index] != LightState.RED) & (seen[:, other.index] != LightState.RED)
                assert not together.any()
