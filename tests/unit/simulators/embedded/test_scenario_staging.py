"""Obstacles, crossings, cut-ins, hazards, standstills: whatever the route file says, they can be staged and driven."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenario_driver import drawn, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import overlap
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.embedded.world import World

TYPES = (
    "Accident", "AccidentTwoWays", "BlockedIntersection", "ConstructionObstacle", "ConstructionObstacleTwoWays",
    "ControlLoss", "DynamicObjectCrossing", "HardBreakRoute", "HazardAtSideLane", "HazardAtSideLaneTwoWays",
    "HighwayCutIn", "InvadingTurn", "ParkedObstacle", "ParkedObstacleTwoWays", "ParkingCrossingPedestrian",
    "ParkingCutIn", "ParkingExit", "PedestrianCrossing", "StaticCutIn", "VehicleOpensDoorTwoWays",
    "VehicleTurningRoute", "VehicleTurningRoutePedestrian",
)  # fmt: skip


def ego_overlaps(world: World) -> list[int]:
    """Actors that exist and reach into the ego."""
    ego, found = world.state.ego, []
    for k, row in enumerate(world.state.actors):
        if world.state.actor_ints[k, c.I_ACTIVE] != 1 or world.state.actor_ints[k, c.I_SOLID] == 0:
            continue
        box = (row[c.A_X], row[c.A_Y], row[c.A_YAW], row[c.A_LENGTH], row[c.A_WIDTH])
        mine = (ego[c.EGO_X], ego[c.EGO_Y], ego[c.EGO_YAW], world.statics.ego_length_m, world.statics.ego_width_m)
        if overlap(*mine, *box)[0] > 0.0:
            found.append(k)
    return found


@pytest.mark.parametrize("name", TYPES)
@settings(max_examples=8)
@given(data=st.data())
def test_any_parameters_can_be_staged_and_leave_room_for_the_ego(name: str, data: st.DataObject) -> None:
    kind = SCENARIOS[name]
    value, metres = st.floats(-60.0, 400.0), st.floats(-10.0, 500.0)
    parameters = {element: {"value": data.draw(value)} for element in kind.parameters}
    for element in kind.intervals:
        parameters[element] = {"from": data.draw(metres), "to": data.draw(metres)}
    route = drawn(name, data.draw(st.integers(0, len(kind.sites) - 1)))
    scenario = replace(route.scenario, parameters=parameters)
    world = World(replace(route, scenario=scenario), seed=data.draw(st.integers(0, 3)))
    assert ego_overlaps(world) == []
    for _ in range(40):
        world.tick(Control(throttle=0.5))
    assert np.isfinite(world.state.actors[:, [c.A_X, c.A_Y, c.A_YAW, c.A_V]]).all()
    assert np.isfinite(world.state.ego).all()


@pytest.mark.parametrize("name", TYPES)
def test_every_site_can_be_staged_with_its_own_parameters(name: str) -> None:
    sites = SCENARIOS[name].sites
    assert 2 <= len(sites) <= 4
    for number in range(len(sites)):
        world = World(drawn(name, number), seed=0)
        assert 49.0 <= world.dense.length_m <= 222.0
        assert world.stage.trigger_m + 20.0 < world.stage.end_m < 400.0
        assert ego_overlaps(world) == []


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("seed", [0, 1])
def test_nobody_stands_in_somebody_else_at_the_start(name: str, seed: int) -> None:
    world = staged(name, seed=seed)
    rows, ints = world.state.actors, world.state.actor_ints
    there = np.flatnonzero((ints[:, c.I_ACTIVE] == 1) & (ints[:, c.I_SOLID] == 1))
    boxes = [tuple(rows[k][[c.A_X, c.A_Y, c.A_YAW, c.A_LENGTH, c.A_WIDTH]]) for k in there]
    assert len(boxes) > 0 or name == "ControlLoss"
    for k, box in enumerate(boxes):
        assert all(overlap(*box, *other)[0] <= 0.0 for other in boxes[k + 1 :])
