"""The world's own semantics: what moves, how, and what it never does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import ActorKind, LightState, WorldState
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import overlap
from pytest_drive_robust.simulators.embedded.kernels.drivers import idm as idm_kernel
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.simulators.embedded.world import World

ROUTES = named_routes("full")
BY_TYPE = {route.scenario.type: route for route in reversed(ROUTES)}
STREET = BY_TYPE["DynamicObjectCrossing"]
FULL_BRAKE = Control(brake=1.0)


def driven(route: Route, control: Control, ticks: int, *, seed: int = 0) -> World:
    world = World(route, seed=seed)
    for _ in range(ticks):
        world.tick(control)
    return world


def test_full_brake_never_becomes_reverse() -> None:
    world = driven(STREET, Control(throttle=1.0), 60)
    assert world.state.ego[c.EGO_V] > 5.0
    speeds = []
    for _ in range(200):
        world.tick(FULL_BRAKE)
        speeds.append(float(world.state.ego[c.EGO_V]))
    assert min(speeds) == 0.0
    assert speeds[-1] == 0.0


def test_a_standing_ego_stays_where_it_is() -> None:
    world = World(BY_TYPE["VanillaSignalizedTurnEncounterRedLight"], seed=0)
    before = world.state.ego[:3].copy()
    for _ in range(100):
        world.tick(FULL_BRAKE)
    assert np.array_equal(world.state.ego[:3], before)


def test_steering_to_the_right_turns_clockwise() -> None:
    world = driven(STREET, Control(throttle=0.5), 40)
    yaw = float(world.state.ego[c.EGO_YAW])
    for _ in range(20):
        world.tick(Control(throttle=0.2, steer=0.5))
    assert math.sin(world.state.ego[c.EGO_YAW] - yaw) > 0.05
    assert world.state.ego[c.EGO_RIGHT] > 0.0


def test_steering_turns_the_wheels_at_once() -> None:
    world = driven(STREET, Control(throttle=0.5), 20)
    world.tick(Control(throttle=0.5, steer=1.0))
    assert world.state.ego[c.EGO_STEER] == pytest.approx(0.368, abs=0.001)


def test_lateral_acceleration_has_a_limit() -> None:
    world = driven(STREET, Control(throttle=1.0), 120)
    felt = []
    for _ in range(60):
        world.tick(Control(throttle=1.0, steer=1.0))
        felt.append(abs(float(world.state.ego[c.EGO_RIGHT])))
    assert 9.0 < max(felt) <= 10.0


@uncached_entry
def idm(v: float, target: float, gap: float, leader_v: float, accel_max: float, brake_max: float) -> float:
    return idm_kernel(v, target, gap, leader_v, accel_max, brake_max)


@given(
    gap=st.floats(-2.0, 200.0),
    v=st.floats(0.0, 40.0),
    leader=st.floats(0.0, 40.0),
    target=st.floats(0.0, 40.0),
)
def test_the_driver_model_stays_within_what_a_car_can_do(gap: float, v: float, leader: float, target: float) -> None:
    accel = idm(v, target, gap, leader, 2.0, 6.0)
    assert -6.0 <= accel <= 2.0


def test_the_driver_model_brakes_for_what_it_would_hit_and_only_then() -> None:
    assert idm(10.0, 12.0, 5.0, 0.0, 2.0, 6.0) < -3.0
    assert idm(10.0, 12.0, math.inf, 0.0, 2.0, 6.0) > 0.5


BOX = st.tuples(
    st.floats(-6, 6), st.floats(-6, 6), st.floats(-math.pi, math.pi), st.floats(0.3, 6.0), st.floats(0.3, 6.0)
)


@settings(max_examples=300)
@given(one=BOX, other=BOX)
def test_contact_is_the_overlap_of_two_boxes(one: tuple[float, ...], other: tuple[float, ...]) -> None:
    depth, nx, ny = overlap(*one, *other)
    inside = _grid_overlap(one, other)
    if inside:
        assert depth > 0.0
    if depth > 0.0:
        assert math.hypot(nx, ny) == pytest.approx(1.0)
        moved = (one[0] + nx * (depth + 1e-6), one[1] + ny * (depth + 1e-6), *one[2:])
        assert overlap(*moved, *other)[0] == 0.0


def _grid_overlap(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Some point of a grid in the first box lies within the second: an independent, one-sided check."""
    u, v = np.meshgrid(np.linspace(-0.499, 0.499, 25), np.linspace(-0.499, 0.499, 25))
    x = one[0] + u * one[3] * math.cos(one[2]) - v * one[4] * math.sin(one[2])
    y = one[1] + u * one[3] * math.sin(one[2]) + v * one[4] * math.cos(one[2])
    dx, dy = x - other[0], y - other[1]
    along = dx * math.cos(other[2]) + dy * math.sin(other[2])
    beside = -dx * math.sin(other[2]) + dy * math.cos(other[2])
    return bool(((np.abs(along) < other[3] / 2) & (np.abs(beside) < other[4] / 2)).any())


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.label.replace(" ", "-"))
def test_nobody_stands_in_the_ego_at_the_start(route: Route) -> None:
    for seed in range(3):
        state = World(route, seed=seed).now()
        for actor in state.actors:
            depth, _, _ = overlap(
                state.ego.x_m,
                state.ego.y_m,
                state.ego.yaw_rad,
                state.ego.length_m,
                state.ego.width_m,
                actor[WorldState.X],
                actor[WorldState.Y],
                actor[WorldState.YAW],
                actor[WorldState.LENGTH],
                actor[WorldState.WIDTH],
            )
            assert depth == 0.0, ActorKind(int(actor[WorldState.KIND]))


@pytest.mark.parametrize("route", BY_TYPE.values(), ids=lambda route: route.label.replace(" ", "-"))
def test_traffic_does_not_crash_into_each_other_without_an_ego(route: Route) -> None:
    world = World(route, seed=1)
    world.state.ego[[c.EGO_X, c.EGO_Y]] += 1e4  # far away
    for _ in range(600):
        world.tick(FULL_BRAKE)
        cars = world.now().actors
        cars = cars[(cars[:, WorldState.KIND] <= ActorKind.BICYCLE) & (cars[:, WorldState.SPEED] > 0.1)]
        for i in range(len(cars)):
            for j in range(i):
                a, b = cars[i], cars[j]
                assert overlap(a[2], a[3], a[4], a[6], a[7], b[2], b[3], b[4], b[6], b[7])[0] == 0.0, (a, b)


def hits_of(world: World) -> np.ndarray:
    events = world.state.noted()
    return events[events[:, c.EV_KIND] == c.EVENT_COLLISION]


def test_driving_into_a_parked_car_stops_the_ego_and_counts_once() -> None:
    world = driven(BY_TYPE["ParkedObstacle"], Control(throttle=0.5), 400)
    hits = hits_of(world)
    assert len(hits) == 1
    assert hits[0, c.EV_VALUE] > 5.0
    assert world.state.ego[c.EGO_V] < 1.0


@pytest.mark.parametrize("throttle", [0.3, 0.75, 1.0])
def test_an_ego_that_presses_against_what_it_hit_stands(throttle: float) -> None:
    world = driven(BY_TYPE["ParkedObstacle"], Control(throttle=1.0), 300)
    assert len(hits_of(world)) == 1
    stood_s, place = float(world.state.criteria[c.C_STILL_S]), world.state.ego[:3].copy()
    for _ in range(100):
        world.tick(Control(throttle=throttle))
        assert world.state.ego[c.EGO_V] == world.state.ego[c.EGO_FORWARD] == 0.0
    assert np.array_equal(world.state.ego[:3], place)
    assert world.state.criteria[c.C_STILL_S] == pytest.approx(stood_s + 5.0)


def test_an_ego_that_scrapes_along_what_it_hit_goes_on() -> None:
    world = driven(BY_TYPE["ParkedObstacle"], Control(throttle=1.0), 300)
    other = world.state.actors[int(hits_of(world)[0, c.EV_ACTOR])]
    yaw, beside_m = float(other[c.A_YAW]), 0.5 * float(other[c.A_WIDTH] + world.now().ego.width_m)
    along, left = (math.cos(yaw), math.sin(yaw)), (math.sin(yaw), -math.cos(yaw))
    x, y = (float(other[at]) + beside_m * left[k] - 2.0 * along[k] for k, at in enumerate((c.A_X, c.A_Y)))
    world.place_ego(x, y, yaw + 0.03, 0.0)
    for _ in range(60):
        world.tick(Control(throttle=0.5))
    moved_m = (world.state.ego[c.EGO_X] - x) * along[0] + (world.state.ego[c.EGO_Y] - y) * along[1]
    assert moved_m > 3.0


@settings(max_examples=25, deadline=None)
@given(route=st.sampled_from(sorted(BY_TYPE)), seed=st.integers(0, 2**32 - 1))
def test_acceleration_is_the_change_of_speed_whatever_is_hit(route: str, seed: int) -> None:
    world, rng = World(BY_TYPE[route], seed=0), np.random.default_rng(seed)
    for tick in range(400):
        if tick % 20 == 0:
            throttle, steer, brake = rng.uniform(0.3, 1.0), rng.normal(0.0, 0.1), float(rng.random() < 0.1)
        before = float(world.state.ego[c.EGO_V])
        world.tick(Control(throttle=throttle, steer=min(max(steer, -1.0), 1.0), brake=brake))
        change = float(world.state.ego[c.EGO_V]) - before
        assert world.state.ego[c.EGO_FORWARD] == pytest.approx(change / 0.05, abs=1e-12)


def test_a_pedestrian_is_hit_once_and_does_not_stop_the_car() -> None:
    simulator = EmbeddedSimulator()
    simulator.reset(BY_TYPE["DynamicObjectCrossing"], seed=0, cameras=())
    while simulator.done is None:
        simulator.step(Control(throttle=0.4))
    score = simulator.score()
    assert [i.kind.value for i in score.infractions] == ["collisions_pedestrian"]
    assert score.route_completion_pct == 100.0


def test_lights_follow_their_program() -> None:
    route = BY_TYPE["VanillaSignalizedTurnEncounterRedLight"]
    world = World(route, seed=0)
    ego_line = next(
        line.index
        for line in world.lane_map.stop_lines
        if np.hypot(world.dense.rows[:, 0] - line.x_m, world.dense.rows[:, 1] - line.y_m).min() < 1.0
        and math.cos(line.heading_rad - world.dense.rows[0, 2]) > 0.9
    )
    seen = []
    while world.state.clock[c.STARTED] < 0:
        world.tick(Control(throttle=0.6))
    for _ in range(160):
        world.tick(FULL_BRAKE)
        seen.append(LightState(int(world.state.lights[ego_line])))
    assert seen[0] is LightState.RED
    # 5 s of red after the scenario started
    assert seen.index(LightState.GREEN) == pytest.approx(100, abs=2)


def test_a_snapshot_brings_everything_back() -> None:
    world = driven(BY_TYPE["NonSignalizedJunctionRightTurn"], Control(throttle=0.5), 50)
    snapshot = world.snapshot()
    first = [driven_on(world, 100)]
    world.restore(snapshot)
    assert [driven_on(world, 100)] == first


def driven_on(world: World, ticks: int) -> bytes:
    for k in range(ticks):
        world.tick(Control(throttle=0.4, steer=0.1 * math.sin(k / 5.0)))
    return b"".join(array.tobytes() for array in world.state)


def test_seeds_change_the_traffic_and_nothing_else_does() -> None:
    route = BY_TYPE["NonSignalizedJunctionRightTurn"]
    same = [World(route, seed=3).now().actors.tobytes() for _ in range(2)]
    assert same[0] == same[1]
    assert World(route, seed=4).now().actors.tobytes() != same[0]


def test_the_tick_cap_ends_an_episode_and_names_itself() -> None:
    simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=50))
    simulator.reset(STREET, seed=0, cameras=())
    while simulator.done is None:
        simulator.step(FULL_BRAKE)
    score = simulator.score()
    assert score.end.value == "Failed - TickRuntime"
    assert "50 ticks" in score.end_detail


def test_an_early_stop_is_an_option_and_names_itself() -> None:
    simulator = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=10.0))
    simulator.reset(STREET, seed=0, cameras=())
    ticks = 0
    while simulator.done is None:
        simulator.step(FULL_BRAKE)
        ticks += 1
    assert ticks == pytest.approx(200, abs=2)
    assert "stopped early" in simulator.score().end_detail


def test_standing_for_a_minute_is_blocked_unless_the_scenario_switches_the_test_off() -> None:
    ends = {}
    for name in ("DynamicObjectCrossing", "ParkedObstacle"):
        simulator = EmbeddedSimulator()
        simulator.reset(BY_TYPE[name], seed=0, cameras=())
        while simulator.done is None:
            started = simulator.world.state.clock[c.STARTED] >= 0
            simulator.step(FULL_BRAKE if started else Control(throttle=0.5))
        ends[name] = simulator.score().end.value
    assert ends == {"DynamicObjectCrossing": "Failed - Agent got blocked", "ParkedObstacle": "Failed - TickRuntime"}
