"""Flows that must be crossed or joined: gaps, speeds, manners; lights in turn; who takes the ego's right of way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scenario_driver import actors_of, away_m, beside_route, collisions, drawn, drive, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import ActorKind, LightState, WorldState
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import overlap
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.embedded.world import World

Floats = NDArray[np.float64]
FULL_BRAKE = Control(brake=1.0)
FLOWS = (
    "CrossingBicycleFlow", "EnterActorFlow", "HighwayExit", "InterurbanActorFlow", "InterurbanAdvancedActorFlow",
    "MergerIntoSlowTraffic", "MergerIntoSlowTrafficV2", "NonSignalizedJunctionLeftTurn",
    "NonSignalizedJunctionLeftTurnEnterFlow", "NonSignalizedJunctionRightTurn", "SignalizedJunctionLeftTurn",
    "SignalizedJunctionLeftTurnEnterFlow", "SignalizedJunctionRightTurn",
)  # fmt: skip
RED_FIRST = (
    "CrossingBicycleFlow", "SignalizedJunctionLeftTurn", "SignalizedJunctionLeftTurnEnterFlow",
    "SignalizedJunctionRightTurn", "VanillaSignalizedTurnEncounterRedLight",
)  # fmt: skip
TAKERS = ("OppositeVehicleRunningRedLight", "OppositeVehicleTakingPriority")


def file_flows(world: World) -> list[NDArray[np.int64]]:
    """The actors of each flow that the route file asks for, from the first on its way to the last."""
    found = []
    for flow in np.unique(world.state.actor_ints[:, c.I_FLOW]):
        members = np.flatnonzero(
            (world.state.actor_ints[:, c.I_FLOW] == flow)
            & (world.state.actor_ints[:, c.I_BACKGROUND] == 0)
            & (world.state.actor_ints[:, c.I_ACTIVE] == 1)
        )
        if flow >= 0 and len(members):
            found.append(members[np.argsort(-world.state.actors[members, c.A_S])])
    return found


def gaps_m(world: World, members: NDArray[np.int64]) -> Floats:
    """Rear of one to front of the next, in metres."""
    rows = world.state.actors[members]
    half = 0.5 * (rows[:-1, c.A_LENGTH] + rows[1:, c.A_LENGTH])
    return np.asarray(rows[:-1, c.A_S] - rows[1:, c.A_S] - half)


def light_of_ego(world: World) -> int:
    """The stop line on the route."""
    rows = world.dense.rows
    for line in world.lane_map.stop_lines:
        away = np.hypot(rows[:, 0] - line.x_m, rows[:, 1] - line.y_m)
        if away.min() < 1.0 and math.cos(rows[int(away.argmin()), 2] - line.heading_rad) > 0.9:
            return line.index
    raise AssertionError("no light on the route")


def lights_after_waking(world: World, ticks: int) -> NDArray[np.int64]:
    """(ticks, lines): drive until the scenario wakes up, then stand and watch."""
    assert drive(world, 20.0, speed_mps=5.0, until=lambda w: bool(w.state.clock[1] >= 0))
    seen = []
    for _ in range(ticks):
        world.tick(FULL_BRAKE)
        seen.append(world.state.lights.copy())
    return np.array(seen)


# --- flows ---


@pytest.mark.parametrize("name", FLOWS)
def test_gaps_and_speed_are_those_of_the_route_file(name: str) -> None:
    for number in range(len(SCENARIOS[name].sites)):
        world = World(drawn(name, number), seed=number)
        spec = world.dense.route.scenario
        low = spec.number("source_dist_interval", math.nan, attribute="from")
        high = spec.number("source_dist_interval", math.nan, attribute="to")
        flows = file_flows(world)
        assert flows
        for members in flows:
            gaps = gaps_m(world, members)
            # the drawn gaps hold between the longest kinds; every third may be twice as long
            assert gaps.min() >= max(low, 4.0) - 1e-6
            assert gaps.max() <= 2.0 * high + 1.1
            assert world.state.actors[members, c.A_V] == pytest.approx(spec.number("flow_speed", math.nan))


@pytest.mark.parametrize("name", FLOWS)
def test_a_flow_keeps_its_speed_however_dense_it_is(name: str) -> None:
    world = staged(name)
    world.state.ego[c.EGO_X] += 1e4  # nobody in its way
    before = world.state.actors[file_flows(world)[0][0], c.A_V]
    for _ in range(120):
        world.tick(FULL_BRAKE)
    for members in file_flows(world):
        assert world.state.actors[members, c.A_V] == pytest.approx(before, rel=1e-6)


@pytest.mark.parametrize("name", FLOWS)
def test_the_flow_comes_to_where_the_ego_must_go(name: str) -> None:
    for number in range(len(SCENARIOS[name].sites)):
        world = World(drawn(name, number), seed=0)
        rows = world.dense.rows
        path = world.stage.paths[int(world.state.actor_ints[file_flows(world)[0][0], c.I_PATH])]
        away = np.hypot(rows[:, None, 0] - path[:, 0], rows[:, None, 1] - path[:, 1])
        assert away.min() < 1.0
        assert away[0].min() > 1.5  # not where it starts


@pytest.mark.parametrize("name", ["NonSignalizedJunctionLeftTurn", "NonSignalizedJunctionRightTurn"])
def test_the_first_to_come_find_no_wide_gap_and_the_patient_do(name: str) -> None:
    world = staged(name)
    high = world.dense.route.scenario.number("source_dist_interval", math.nan, attribute="to")
    world.state.ego[c.EGO_X] += 1e4
    members = file_flows(world)[0]
    meets = world.stage.along(int(world.state.actor_ints[members[0], c.I_PATH]), world.stage.junction_ahead_m())
    passed: list[float] = []  # when somebody passes
    before = world.state.actors[:, c.A_S].copy()
    slots = world.state.actor_ints[:, c.I_FLOW] == world.state.actor_ints[members[0], c.I_FLOW]
    for _ in range(1000):
        world.tick(FULL_BRAKE)
        now = world.state.actors[:, c.A_S]
        passed.extend([world.state.clock[0] * 0.05] * int((slots & (before < meets) & (now >= meets)).sum()))
        before = now.copy()
    apart = np.diff(passed) * world.state.flows[0, c.F_SPEED]
    early = np.array(passed[1:]) < 10.0
    assert apart[early].max() < high + 6.2
    assert apart[~early].max() > high + 6.2


def test_who_comes_late_is_overlooked_until_he_is_in_the_middle_of_the_lane() -> None:
    braking = {}
    for aside in (1.6, 0.0):
        world = staged("NonSignalizedJunctionLeftTurn")
        car = int(file_flows(world)[0][-2])
        row = world.state.actors[car]
        yaw = float(row[c.A_YAW])
        ahead = 12.0
        world.state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = (
            row[c.A_X] + ahead * math.cos(yaw) - aside * math.sin(yaw),
            row[c.A_Y] + ahead * math.sin(yaw) + aside * math.cos(yaw),
            yaw,
            0.0,
        )
        world.tick(FULL_BRAKE)
        braking[aside] = float(world.state.actors[car, c.A_ACCEL])
    assert braking[1.6] == pytest.approx(0.0, abs=0.01)
    assert braking[0.0] < -3.0


def test_who_comes_late_scrapes_past_an_ego_that_stands_in_the_way_instead_of_blocking_the_road() -> None:
    world = staged("NonSignalizedJunctionLeftTurn")
    car = int(file_flows(world)[0][-2])
    row, start = world.state.actors[car], float(world.state.actors[car, c.A_S])
    yaw, ahead, aside = float(row[c.A_YAW]), 12.0, 1.6
    x, y = row[c.A_X] + ahead * math.cos(yaw), row[c.A_Y] + ahead * math.sin(yaw)
    world.state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = (
        x - aside * math.sin(yaw), y + aside * math.cos(yaw), yaw, 0.0
    )  # fmt: skip
    before = world.state.ego[:2].copy()
    for _ in range(80):
        world.tick(FULL_BRAKE)
    assert np.hypot(*(world.state.ego[:2] - before)) > 0.1  # it was pushed aside
    assert collisions(world) == []
    assert world.state.actors[car, c.A_S] > start + 25.0


def test_bicycles_ride_on_their_own_lane_beside_the_cars() -> None:
    for number in range(len(SCENARIOS["CrossingBicycleFlow"].sites)):
        world = World(drawn("CrossingBicycleFlow", number), seed=0)
        assert {int(k) for m in file_flows(world) for k in world.state.actor_ints[m, c.I_KIND]} == {ActorKind.BICYCLE}


def test_two_flows_meet_who_turns_left_onto_a_country_road() -> None:
    world = staged("InterurbanAdvancedActorFlow")
    first, second = file_flows(world)
    yaws = [float(world.state.actors[members[0], c.A_YAW]) for members in (first, second)]
    assert math.cos(yaws[0] - yaws[1]) == pytest.approx(-1.0, abs=0.05)


@pytest.mark.parametrize("name", [*FLOWS, "SequentialLaneChange", "T_Junction", "VanillaNonSignalizedTurn"])
def test_traffic_stays_out_of_each_other_where_no_ego_disturbs_it(name: str) -> None:
    for number in range(min(len(SCENARIOS[name].sites), 3)):
        world = World(drawn(name, number), seed=1)
        world.state.ego[c.EGO_X] += 1e4
        for _ in range(50):
            for _ in range(8):
                world.tick(FULL_BRAKE)
            cars = world.frame().actors[
                :, [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH]
            ]
            for i in range(len(cars)):
                near = np.hypot(cars[:i, 0] - cars[i, 0], cars[:i, 1] - cars[i, 1]) < 8.0
                assert all(overlap(*cars[i], *other)[0] == 0.0 for other in cars[:i][near])


# --- lights ---


@pytest.mark.parametrize("name", RED_FIRST)
def test_the_light_is_red_for_five_seconds_after_the_trigger_then_green(name: str) -> None:
    for number in range(len(SCENARIOS[name].sites)):
        world = World(drawn(name, number), seed=0)
        line = light_of_ego(world)
        assert world.frame().lights[line] == LightState.RED
        seen = lights_after_waking(world, 160)[:, line]
        assert seen[0] == LightState.RED
        assert int(np.argmax(seen == LightState.GREEN)) == pytest.approx(100, abs=2)
        assert (seen[102:] == LightState.GREEN).all()


def test_the_green_light_turns_red_for_five_seconds_after_five() -> None:
    for number in range(len(SCENARIOS["VanillaSignalizedTurnEncounterGreenLight"].sites)):
        world = World(drawn("VanillaSignalizedTurnEncounterGreenLight", number), seed=0)
        line = light_of_ego(world)
        assert world.frame().lights[line] == LightState.GREEN
        seen = [LightState(int(state)) for state in lights_after_waking(world, 300)[:, line]]
        assert seen.index(LightState.YELLOW) == pytest.approx(100, abs=2)
        red = [k for k, state in enumerate(seen) if state is LightState.RED]
        assert len(red) == 100
        assert red[0] == pytest.approx(140, abs=2)
        assert seen[-1] is LightState.GREEN


@pytest.mark.parametrize(
    "name", ["T_Junction", "VanillaSignalizedTurnEncounterGreenLight", "VanillaSignalizedTurnEncounterRedLight"]
)
def test_roads_that_cross_never_have_green_together(name: str) -> None:
    world = staged(name)
    lines = [line for line in world.lane_map.stop_lines if line.is_light]
    seen = lights_after_waking(world, 320)
    for one in lines:
        for other in lines:
            if abs(math.cos(one.heading_rad - other.heading_rad)) < 0.1:
                together = (seen[:, one.index] != LightState.RED) & (seen[:, other.index] != LightState.RED)
                assert not together.any()


# --- who takes the right of way ---


def runner_of(world: World) -> int:
    return next(k for k in range(len(world.state.actor_ints)) if world.state.actor_ints[k, c.I_SEES] == c.SEES_NOBODY)


@pytest.mark.parametrize("name", TAKERS)
@pytest.mark.parametrize("speed_mps", [5.0, 8.0, 11.0])
def test_who_does_not_react_is_hit_or_missed_by_a_hair(name: str, speed_mps: float) -> None:
    for number in range(len(SCENARIOS[name].sites)):
        world = World(drawn(name, number), seed=0)
        runner, nearest = runner_of(world), math.inf
        while world.state.criteria_ints[c.CI_PROGRESS] < len(world.dense.rows) - 5 and not collisions(world):
            drive(world, 0.05, speed_mps=speed_mps)
            nearest = min(nearest, away_m(world, runner))
        assert collisions(world) == [runner] or nearest < 12.0
        if speed_mps > 7.0 and "straight" in SCENARIOS[name].sites[number].chain:
            assert collisions(world) == [runner]


@pytest.mark.parametrize("name", TAKERS)
def test_who_brakes_within_a_second_stays_clear(name: str) -> None:
    for number in range(len(SCENARIOS[name].sites)):
        world = World(drawn(name, number), seed=0)
        runner = runner_of(world)
        assert drive(world, 30.0, speed_mps=9.0, until=lambda w: bool(w.state.actors[runner_of(w), c.A_V] > 0.0))
        drive(world, 0.8, speed_mps=9.0)
        drive(world, 4.0, speed_mps=0.0)
        assert collisions(world) == []
        assert world.state.actor_ints[runner, c.I_ACTIVE] == 1 or world.state.actors[runner, c.A_S] > 0.0


def test_the_runner_waits_until_the_ego_is_near_and_does_sixty() -> None:
    world = staged("OppositeVehicleRunningRedLight")
    runner, fastest = runner_of(world), 0.0
    while world.state.actors[runner, c.A_V] == 0.0:
        assert drive(world, 0.05, speed_mps=8.0) is False
        assert world.state.clock[0] < 400
    assert 8.0 < away_m(world, runner) < 60.0
    for _ in range(60):
        world.tick(FULL_BRAKE)
        fastest = max(fastest, float(world.state.actors[runner, c.A_V]))
    assert fastest == pytest.approx(60.0 / 3.6, rel=0.03)


def test_the_runner_comes_from_where_the_route_file_says() -> None:
    route = drawn("OppositeVehicleTakingPriority")
    sides = {}
    for direction in ("left", "right"):
        spec = replace(route.scenario, texts={"direction": direction})
        world = World(replace(route, scenario=spec), seed=0)
        sides[direction] = beside_route(world, runner_of(world))[1]
    assert sides["left"] < -8.0
    assert sides["right"] > 8.0


def test_a_direction_that_no_road_comes_from_is_refused() -> None:
    route = drawn("OppositeVehicleTakingPriority")
    spec = replace(route.scenario, texts={"direction": "behind"})
    with pytest.raises(RouteError, match=r"'behind'.*left, right, opposite"):
        World(replace(route, scenario=spec), seed=0)


# --- the emergency vehicle ---


def siren_is_there(world: World) -> bool:
    (siren,) = actors_of(world, ActorKind.EMERGENCY)
    return bool(world.state.actor_ints[siren, c.I_ACTIVE] == 1)


def test_the_emergency_vehicle_comes_from_behind_once_the_scenario_wakes_up() -> None:
    for number in range(len(SCENARIOS["YieldToEmergencyVehicle"].sites)):
        world = World(drawn("YieldToEmergencyVehicle", number), seed=0)
        (siren,) = actors_of(world, ActorKind.EMERGENCY)
        assert world.state.actor_ints[siren, c.I_ACTIVE] != 1
        assert drive(world, 20.0, speed_mps=8.0, until=siren_is_there)
        distance = world.dense.route.scenario.number("distance", math.nan)
        ahead, right = beside_route(world, siren)
        assert ahead == pytest.approx(-distance, abs=2.5)
        assert abs(right) < 0.5
        before = away_m(world, siren)
        drive(world, 3.0, speed_mps=8.0)
        assert away_m(world, siren) < before - 5.0
