"""Every scenario type: whatever the route file says, it can be staged and driven."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenario_driver import drawn, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import RoadOption, Route
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.dense_route import lay_route
from pytest_drive_robust.simulators.embedded.generate import all_sites
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
    route = drawn(name, data.draw(st.integers(0, len(all_sites()[name]) - 1)))
    scenario = replace(route.scenario, parameters=parameters)
    world = World(replace(route, scenario=scenario), seed=data.draw(st.integers(0, 3)))
    assert ego_overlaps(world) == []
    for _ in range(40):
        world.tick(Control(throttle=0.5))
    assert np.isfinite(world.state.actors[:, [c.A_X, c.A_Y, c.A_YAW, c.A_V]]).all()
    assert np.isfinite(world.state.ego).all()


@pytest.mark.parametrize("name", TYPES)
def test_every_site_can_be_staged_with_its_own_parameters(name: str) -> None:
    sites = all_sites()[name]
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


TURNS = {
    "EnterActorFlow": {RoadOption.RIGHT},
    "InterurbanActorFlow": {RoadOption.LEFT},
    "InterurbanAdvancedActorFlow": {RoadOption.LEFT},
    "NonSignalizedJunctionLeftTurn": {RoadOption.LEFT},
    "NonSignalizedJunctionLeftTurnEnterFlow": {RoadOption.LEFT},
    "NonSignalizedJunctionRightTurn": {RoadOption.RIGHT},
    "SignalizedJunctionLeftTurn": {RoadOption.LEFT},
    "SignalizedJunctionLeftTurnEnterFlow": {RoadOption.LEFT},
    "SignalizedJunctionRightTurn": {RoadOption.RIGHT},
}
LANE_CHANGES = {
    "HighwayExit": 1, "MergerIntoSlowTraffic": 1, "MergerIntoSlowTrafficV2": 1, "SequentialLaneChange": 2
}  # fmt: skip
OTHERS = (
    "CrossingBicycleFlow", "OppositeVehicleRunningRedLight", "OppositeVehicleTakingPriority", "T_Junction",
    "VanillaNonSignalizedTurn", "VanillaNonSignalizedTurnEncounterStopsign",
    "VanillaSignalizedTurnEncounterGreenLight", "VanillaSignalizedTurnEncounterRedLight", "YieldToEmergencyVehicle",
)  # fmt: skip
FLOW_TYPES = (*TURNS, *LANE_CHANGES, *OTHERS)
BLOCKED_TEST_ON = {name for name in OTHERS if name.startswith(("Vanilla", "Opposite", "Yield"))}


def nobody_in_the_ego(world: World) -> bool:
    ego = world.state.ego
    mine = (ego[c.EGO_X], ego[c.EGO_Y], ego[c.EGO_YAW], world.statics.ego_length_m, world.statics.ego_width_m)
    there = world.state.actors[world.state.actor_ints[:, c.I_ACTIVE] == 1]
    boxes = there[:, [c.A_X, c.A_Y, c.A_YAW, c.A_LENGTH, c.A_WIDTH]]
    return all(overlap(*mine, *(float(v) for v in box))[0] == 0.0 for box in boxes)


def commands(route: Route) -> list[RoadOption]:
    return [point.command for point in lay_route(route).plan().points]


@pytest.mark.parametrize("name", FLOW_TYPES)
@settings(max_examples=6)
@given(data=st.data())
def test_any_parameters_of_a_flow_can_be_staged_and_leave_room_for_the_ego(name: str, data: st.DataObject) -> None:
    kind = SCENARIOS[name]
    value, metres = st.floats(0.5, 60.0), st.floats(-5.0, 300.0)
    parameters = {element: {"value": data.draw(value)} for element in kind.parameters}
    for element in kind.intervals:
        parameters[element] = {"from": data.draw(metres), "to": data.draw(metres)}
    route = drawn(name, data.draw(st.integers(0, len(all_sites()[name]) - 1)))
    scenario = replace(route.scenario, parameters=parameters)
    world = World(replace(route, scenario=scenario), seed=data.draw(st.integers(0, 3)))
    assert nobody_in_the_ego(world)
    for _ in range(40):
        world.tick(Control(throttle=0.5))
    assert np.isfinite(world.state.actors[:, [c.A_X, c.A_Y, c.A_YAW, c.A_V]]).all()
    assert np.isfinite(world.state.ego).all()


@pytest.mark.parametrize("name", FLOW_TYPES)
def test_a_route_file_may_leave_every_parameter_out(name: str) -> None:
    route = drawn(name)
    world = World(replace(route, scenario=replace(route.scenario, parameters={}, texts={})), seed=0)
    assert nobody_in_the_ego(world)


@pytest.mark.parametrize("name", TURNS)
def test_turns_are_commanded(name: str) -> None:
    for number in range(len(all_sites()[name])):
        turns = {RoadOption.LEFT, RoadOption.RIGHT, RoadOption.STRAIGHT} & set(commands(drawn(name, number)))
        assert turns == TURNS[name]


@pytest.mark.parametrize(("name", "at_least"), LANE_CHANGES.items())
def test_lane_changes_are_commanded(name: str, at_least: int) -> None:
    changes = {RoadOption.CHANGE_LANE_LEFT, RoadOption.CHANGE_LANE_RIGHT}
    for number in range(len(all_sites()[name])):
        plan = commands(drawn(name, number))
        begun = [now for before, now in pairwise(plan) if now in changes and now is not before]
        assert len(begun) == at_least


def test_the_blocked_test_sleeps_where_waiting_belongs_to_the_task() -> None:
    assert {name for name in FLOW_TYPES if not SCENARIOS[name].blocked_test_off} == BLOCKED_TEST_ON


@pytest.mark.parametrize("name", FLOW_TYPES)
def test_the_scenario_ends_behind_its_trigger_and_each_type_knows_several_places(name: str) -> None:
    sites = all_sites()[name]
    assert len(sites) >= 2
    for number in range(len(sites)):
        world = World(drawn(name, number), seed=0)
        assert world.statics.trigger_m < world.statics.scenario_end_m < np.inf


def test_a_flow_crossing_type_on_a_road_without_a_junction_is_refused() -> None:
    street = drawn("YieldToEmergencyVehicle")
    spec = drawn("NonSignalizedJunctionLeftTurn").scenario
    with pytest.raises(RouteError, match="junction"):
        World(replace(street, scenario=replace(spec, trigger=street.scenario.trigger)), seed=0)
