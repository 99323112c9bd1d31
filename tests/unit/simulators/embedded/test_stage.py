"""The building blocks that scenario definitions use, each on a stage of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import ActorKind, LightState
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import ActorSpec, Arrival, Script
from pytest_drive_robust.simulators.embedded.generate import draw_route
from pytest_drive_robust.simulators.embedded.light_programs import GREEN, RED, green_then_red
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS, ScenarioType
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.world import World

COAST = Control(throttle=0.55)
BRAKE = Control(brake=1.0)


def route_of(scenario_type: str) -> Route:
    return draw_route(SCENARIOS[scenario_type], number=0, seed=7, route_id="1")


STREET, CROSSING = "DynamicObjectCrossing", "SignalizedJunctionLeftTurn"


@pytest.fixture
def staged(monkeypatch: pytest.MonkeyPatch) -> Callable[..., World]:
    """A world on the route of some type, whose actors are put there by the test."""

    def build(on: str, put: Callable[[Stage], None]) -> World:
        kind = ScenarioType("Test", put, {}, {}, blocked_test_off=False, two_ways=c.TWO_WAYS_NEVER)
        monkeypatch.setitem(SCENARIOS, "Test", kind)
        route = route_of(on)
        return World(replace(route, scenario=replace(route.scenario, type="Test")), seed=0)

    return build


def drive(world: World, control: Control, ticks: int) -> None:
    for _ in range(ticks):
        world.tick(control)


def test_a_blind_driver_runs_into_what_an_attentive_one_stops_for(staged) -> None:
    def put(stage: Stage, *, blind: bool) -> None:
        oncoming = stage.oncoming()
        stage.cast.add(ActorSpec(ActorKind.CAR, oncoming, stage.along(oncoming, 60.0), mode=c.MODE_STATIC))
        sees = c.SEES_NOBODY if blind else c.SEES_ALL
        stage.cast.add(ActorSpec(ActorKind.CAR, oncoming, stage.along(oncoming, 100.0), 10.0, sees=sees))

    gaps = {}
    for blind in (True, False):
        world = staged(STREET, lambda stage, blind=blind: put(stage, blind=blind))
        drive(world, BRAKE, 160)
        standing, driving = world.state.actors
        gaps[blind] = standing[c.A_ALONG_M] - driving[c.A_ALONG_M]
    assert gaps[True] < 0.0 < 4.6 < gaps[False] < 10.0


def test_dirt_disturbs_the_controls_only_near_it(staged) -> None:
    dirty = staged(STREET, lambda stage: stage.dirt(10.0))
    clean = staged(STREET, lambda stage: None)
    apart = []
    for _ in range(140):
        dirty.tick(COAST)
        clean.tick(COAST)
        away = np.hypot(*(dirty.statics.patches[0] - dirty.state.ego[:2]))
        apart.append((away, float(np.abs(dirty.state.ego[:3] - clean.state.ego[:3]).max())))
    reached = next(k for k, (away, _) in enumerate(apart) if away < 2.0)
    assert max(difference for _, difference in apart[:reached]) == 0.0
    assert apart[-1][1] > 0.01


def test_dirt_is_driven_over_without_a_collision(staged) -> None:
    world = staged(STREET, lambda stage: stage.dirt(10.0))
    drive(world, COAST, 140)
    assert world.state.ego[c.EGO_V] > 3.0
    assert c.EVENT_COLLISION not in world.state.noted()[:, c.EV_KIND]


def test_what_appears_is_neither_seen_nor_hit_before_its_trigger(staged) -> None:
    def put(stage: Stage) -> None:
        door = stage.stand(ActorKind.DOOR, 40.0, appears=True)
        stage.cast.script(door, Arrival(0.0, 12.0), Script(0.0), at=stage.spot(40.0))

    world = staged(STREET, put)
    assert len(world.now().actors) == 0
    ticks = 0
    while len(world.now().actors) == 0:
        world.tick(COAST)
        ticks += 1
        assert ticks < 400
    away = np.hypot(*(world.now().actors[0, 2:4] - world.state.ego[:2]))
    assert 9.0 < away < 12.5
    drive(world, COAST, 60)
    assert c.EVENT_COLLISION in world.state.noted()[:, c.EV_KIND]


def test_the_ego_can_start_beside_the_route_and_rolling(staged) -> None:
    def put(stage: Stage) -> None:
        stage.start_right_m, stage.start_mps = 2.5, 6.0

    world = staged(STREET, put)
    x, y, yaw, _ = world.dense.rows[0]
    offset = world.state.ego[:2] - (x, y)
    assert -offset[0] * np.sin(yaw) + offset[1] * np.cos(yaw) == pytest.approx(2.5)
    assert world.state.ego[c.EGO_V] == 6.0


def test_a_flow_of_bicycles_consists_of_bicycles(staged) -> None:
    world = staged(
        STREET,
        lambda stage: stage.flow(stage.oncoming(), speed_mps=5.0, gap_m=(8.0, 12.0), kinds=(ActorKind.BICYCLE,)),
    )
    assert set(world.now().actors[:, 1].astype(int)) == {int(ActorKind.BICYCLE)}


def test_traffic_on_a_leash_stays_near_a_slow_ego(staged) -> None:
    def put(stage: Stage) -> None:
        path = stage.own()
        for ahead_m in (-30.0, -15.0, 15.0, 30.0):
            start_m = stage.along(path, ahead_m - stage.trigger_m)
            stage.cast.add(ActorSpec(ActorKind.CAR, path, start_m, 6.0, target_mps=12.0, leash=True, background=True))

    world = staged(STREET, put)
    drive(world, Control(throttle=0.12), 300)
    ego = world.state.ego
    cars = world.state.actors[world.state.actor_ints[:, c.I_ACTIVE] == 1]
    assert len(cars) == 4
    ahead = (cars[:, c.A_X] - ego[c.EGO_X]) * np.cos(ego[c.EGO_YAW]) + (cars[:, c.A_Y] - ego[c.EGO_Y]) * np.sin(
        ego[c.EGO_YAW]
    )
    assert (ahead > 0).sum() == 2
    assert np.abs(ahead).max() < 60.0


@pytest.mark.parametrize("bearing", ["left", "right", "opposite"])
def test_traffic_comes_from_the_named_arm(staged, bearing: str) -> None:
    found = {}

    def put(stage: Stage) -> None:
        path = stage.from_arm(bearing)
        found["heading"] = stage.paths[path][0, 2]
        found["own"] = stage.lane_at(0.0).centre[-1, 2]

    staged(CROSSING, put)
    expected = {"left": np.pi / 2.0, "right": -np.pi / 2.0, "opposite": np.pi}[bearing]
    assert np.cos(found["heading"] - found["own"] - expected) > 0.99


def test_the_opposite_flow_can_turn_into_the_exit_of_the_ego(staged) -> None:
    found = {}

    def put(stage: Stage) -> None:
        path = stage.from_arm("opposite", into="exit")
        out = stage.spot(stage.exit_ahead_m() + 8.0)
        found["away"] = np.hypot(*(stage.paths[path][:, :2] - out).T).min()
        with pytest.raises(RouteError, match="needs a way from the left"):
            stage.from_arm("left", into="exit")

    staged(CROSSING, put)
    assert found["away"] < 0.8


def test_the_exit_lies_behind_the_entry_of_the_junction(staged) -> None:
    found = {}

    def put(stage: Stage) -> None:
        found["in"], found["out"] = stage.junction_ahead_m(), stage.exit_ahead_m()

    staged(CROSSING, put)
    assert 8.0 < found["out"] - found["in"] < 45.0


def test_places_that_a_street_does_not_have_are_refused(staged) -> None:
    def put(stage: Stage) -> None:
        assert not stage.has_lane_beside("right")
        with pytest.raises(RouteError, match="needs a driving lane to the right"):
            stage.beside("right")
        with pytest.raises(RouteError, match="needs a junction"):
            stage.junction_ahead_m()

    staged(STREET, put)


def test_a_light_that_turns_red_is_yellow_first(staged) -> None:
    def put(stage: Stage) -> None:
        stage.lights(ego=green_then_red(2.0, 3.0), opposite=GREEN, crossing=RED)

    world = staged(CROSSING, put)
    row = world.dense.first_junction_row()
    here = world.dense.rows[row]
    mine = next(
        line.index
        for line in world.lane_map.stop_lines
        if np.cos(line.heading_rad - here[2]) > 0.9 and np.hypot(line.x_m - here[0], line.y_m - here[1]) < 8.0
    )
    shown: list[LightState] = []
    while world.state.clock[c.STARTED] < 0 or world.state.clock[c.TICK] - world.state.clock[c.STARTED] < 140:
        world.tick(COAST if world.state.clock[c.STARTED] < 0 else BRAKE)
        state = LightState(int(world.state.lights[mine]))
        if not shown or shown[-1] is not state:
            shown.append(state)
    assert shown == [LightState.GREEN, LightState.YELLOW, LightState.RED, LightState.GREEN]
