"""Each criterion is provoked by driving, through the simulator's front door."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.simulators.base import EpisodeScore
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.geometry import place
from pytest_drive_robust.simulators.embedded.kernels.lane_keeping import nearest_lane
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.simulators.embedded.world import World

BY_TYPE = {route.scenario.type: route for route in reversed(named_routes("full"))}


def teleport(simulator: EmbeddedSimulator, s_m: float, *, right_m: float = 0.0, speed_mps: float = 8.0) -> None:
    """Put the ego on the route without driving: criteria only look at where it is."""
    x, y, yaw = place(simulator.world.dense.rows[:, :3], s_m, right_m)
    ego = simulator.world.state.ego
    ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = x, y, yaw, speed_mps


def emptied(scenario: str | Route) -> EmbeddedSimulator:
    """Return the start of a route with an empty road: only the criteria are under test."""
    simulator = EmbeddedSimulator()
    simulator.reset(BY_TYPE[scenario] if isinstance(scenario, str) else scenario, seed=0, cameras=())
    state = simulator.world.state
    state.actor_ints[:, c.I_ACTIVE] = 0
    state.flow_ints[:, c.FI_FIRST_SLOT : c.FI_LAST_SLOT + 1] = 0
    return simulator


def glide(
    scenario: str, *, right_m: Callable[[float], float] = lambda s: 0.0, stop_at: float = math.inf
) -> EpisodeScore:
    """Move the ego along its route at 8 m/s (standing still once at `stop_at` for one second)."""
    simulator = emptied(scenario)
    s, rested = 0.0, 0
    while simulator.done is None:
        standing = s >= stop_at and rested < 20
        rested += standing
        s += 0.0 if standing else 0.4
        teleport(simulator, s, right_m=right_m(s), speed_mps=0.0 if standing else 8.0)
        simulator.step(Control())
    return simulator.score()


def kinds(infractions: tuple[Infraction, ...]) -> list[InfractionKind]:
    return [infraction.kind for infraction in infractions]


def test_the_middle_of_the_route_is_clean() -> None:
    score = glide("DynamicObjectCrossing")
    assert score.end is End.COMPLETED
    assert score.route_completion_pct == 100.0
    assert kinds(score.infractions) == []


def test_running_a_red_light_is_noted_once() -> None:
    score = glide("VanillaSignalizedTurnEncounterRedLight")
    assert kinds(score.infractions) == [InfractionKind.RED_LIGHT]


@pytest.mark.parametrize("route_id", ["3202", "3402"])  # on the left and on the right one of two lanes
@pytest.mark.parametrize("lanes_right", [0.0, -0.5, 0.5, -0.6, 0.6])
def test_a_red_light_counts_once_however_many_of_its_lanes_the_ego_straddles(route_id: str, lanes_right: float) -> None:
    simulator = emptied(next(route for route in named_routes("full") if route.id == route_id))
    world = simulator.world
    world.statics.light_before[:] = LightState.RED
    world.statics.light_states[:] = LightState.RED
    line = next(line for line in world.lane_map.stop_lines if line.lane == world.dense.lanes[0])
    ego, cos, sin = world.state.ego, math.cos(line.heading_rad), math.sin(line.heading_rad)
    right = lanes_right * line.width_m
    for ahead in np.arange(-6.0, 12.0, 0.4):  # 8 m/s
        ego[[c.EGO_X, c.EGO_Y]] = line.x_m + ahead * cos - right * sin, line.y_m + ahead * sin + right * cos
        ego[[c.EGO_YAW, c.EGO_V]] = line.heading_rad, 8.0
        simulator.step(Control())
    noted = kinds(simulator.score().infractions).count(InfractionKind.RED_LIGHT)
    assert noted == 1 or (noted == 0 and abs(lanes_right) > 0.5)


def test_passing_a_stop_sign_without_a_stop_is_noted_once() -> None:
    score = glide("VanillaNonSignalizedTurnEncounterStopsign")
    assert kinds(score.infractions) == [InfractionKind.STOP_SIGN]


def test_coming_to_rest_at_the_line_satisfies_the_stop_sign() -> None:
    simulator = EmbeddedSimulator()
    simulator.reset(BY_TYPE["VanillaNonSignalizedTurnEncounterStopsign"], seed=0, cameras=())
    dense = simulator.world.dense
    line = min(
        simulator.world.lane_map.stop_lines,
        key=lambda each: float(np.hypot(dense.rows[:, 0] - each.x_m, dense.rows[:, 1] - each.y_m).min()),
    )
    at = float(np.argmin(np.hypot(dense.rows[:, 0] - line.x_m, dense.rows[:, 1] - line.y_m)))
    assert kinds(glide("VanillaNonSignalizedTurnEncounterStopsign", stop_at=at - 4.0).infractions) == []


def test_driving_beside_the_lanes_counts_in_metres_of_route() -> None:
    # on an avenue the right lane's right neighbour is the sidewalk: 4 m to the right is outside
    score = glide("ParkedObstacle", right_m=lambda s: 4.0 if 20.0 < s < 50.0 else 0.0)
    outside = [i for i in score.infractions if i.kind is InfractionKind.OUTSIDE_LANES]
    assert len(outside) == 1
    assert abs(outside[0].share_pct - 100.0 * 30.0 / score.route_length_m) < 2.0


def test_the_oncoming_lane_is_outside_unless_the_scenario_allows_it() -> None:
    def aside(s: float) -> float:
        return -3.5 if 50.0 < s < 80.0 else 0.0

    forbidden = glide("DynamicObjectCrossing", right_m=aside)
    allowed = glide("HazardAtSideLaneTwoWays", right_m=aside)
    assert kinds(forbidden.infractions) == [InfractionKind.OUTSIDE_LANES]
    assert kinds(allowed.infractions) == []


def test_beside_bicycles_the_oncoming_lane_stays_allowed_to_the_end() -> None:
    stays = emptied("HazardAtSideLaneTwoWays").world
    over_m = stays.statics.scenario_end_m + 1.0
    assert over_m + 6.0 < stays.dense.length_m
    assert kinds(glide("HazardAtSideLaneTwoWays", right_m=lambda s: -3.5 if s > over_m else 0.0).infractions) == []
    over_m = emptied("ParkedObstacleTwoWays").world.statics.scenario_end_m + 1.0
    late = glide("ParkedObstacleTwoWays", right_m=lambda s: -3.5 if s > over_m else 0.0)
    assert kinds(late.infractions) == [InfractionKind.OUTSIDE_LANES]


@pytest.mark.parametrize(
    ("scenario", "near_m"),
    [("AccidentTwoWays", 50.0), ("ParkedObstacleTwoWays", 50.0), ("ConstructionObstacleTwoWays", 30.0)],
)
def test_the_oncoming_lane_is_allowed_five_seconds_after_the_ego_came_near(scenario: str, near_m: float) -> None:
    world = emptied(scenario).world
    x, y, given_m, given_s = world.statics.two_ways_near
    assert (given_m, given_s) == (near_m, 0.0)
    route = world.dense.rows
    trigger_m = float(world.dense.trigger_m)
    came_m = next(
        s for s, row in zip(world.dense.s, route, strict=True)
        if s >= trigger_m - 2.0 and math.hypot(row[0] - x, row[1] - y) < near_m
    )  # fmt: skip
    free_m = came_m + 5.0 * 8.0  # at 8 m/s
    early = glide(scenario, right_m=lambda s: -3.5 if free_m - 10.0 < s < free_m - 2.0 else 0.0)
    later = glide(scenario, right_m=lambda s: -3.5 if free_m + 3.0 < s < free_m + 11.0 else 0.0)
    assert kinds(early.infractions) == [InfractionKind.OUTSIDE_LANES]
    assert kinds(later.infractions) == []


def test_metres_of_route_far_from_it_end_it_beyond_thirty_percent() -> None:
    length_m = emptied("DynamicObjectCrossing").world.dense.length_m

    def far(share: float) -> EpisodeScore:
        return glide("DynamicObjectCrossing", right_m=lambda s: 16.0 if 20.0 < s < 20.0 + share * length_m else 0.0)

    assert far(0.25).end is End.COMPLETED
    strayed = far(0.40)
    assert strayed.end is End.DEVIATED
    (told,) = [i.detail for i in strayed.infractions if i.kind is InfractionKind.DEVIATION]
    assert told == "went more than 15 m from the route for more than 30 % of it"


def test_metres_that_lead_nowhere_are_not_those_of_the_route() -> None:
    simulator = emptied("DynamicObjectCrossing")
    for tick in range(400):  # 20 s at 8 m/s, 16 m from the route, to and fro over a metre of it: 160 m of 130
        teleport(simulator, 30.0 + 0.5 * (tick % 2), right_m=16.0)
        simulator.step(Control())
    assert simulator.done is None


def test_thirty_metres_from_the_route_ends_it() -> None:
    score = glide("DynamicObjectCrossing", right_m=lambda s: 0.0 if s < 40.0 else 31.0)
    assert score.end is End.DEVIATED
    (told,) = [i.detail for i in score.infractions if i.kind is InfractionKind.DEVIATION]
    assert told == "left the route by more than 30 m"
    assert 20.0 < score.route_completion_pct < 40.0


def test_the_emergency_vehicle_must_get_past_within_ten_seconds() -> None:
    simulator = EmbeddedSimulator()
    simulator.reset(BY_TYPE["YieldToEmergencyVehicle"], seed=0, cameras=())
    s = 0.0
    while simulator.done is None:
        s += 0.4
        teleport(simulator, s, speed_mps=8.0)
        simulator.step(Control())
    assert InfractionKind.YIELD_EMERGENCY in kinds(simulator.score().infractions)


def test_speed_is_compared_with_the_traffic_at_every_twentieth_of_the_route() -> None:
    """By the original's order: first the checkpoint, then the tick's speeds, and one more value near the end."""
    simulator = EmbeddedSimulator()
    simulator.reset(BY_TYPE["DynamicObjectCrossing"], seed=0, cameras=())
    world, s = simulator.world, 0.0
    step_m, passed_m, mine, theirs = world.dense.length_m / 20.0, 0.0, 0.0, 0.0
    expected = []
    while simulator.done is None:
        s += 0.4
        teleport(simulator, s, right_m=0.0, speed_mps=8.0 + math.sin(s))
        world.state.actor_ints[:, c.I_SOLID] = 0
        simulator.step(Control())
        if simulator.progress_m - passed_m > step_m:
            expected.append(round(100.0 * mine / theirs, 2))
            passed_m, mine, theirs = simulator.progress_m, 0.0, 0.0
        ints = world.state.actor_ints
        driving = world.state.actors[(ints[:, c.I_BACKGROUND] == 1) & (ints[:, c.I_ACTIVE] == 1), c.A_V]
        mine, theirs = mine + world.state.ego[c.EGO_V], theirs + driving.mean()
    ratios = simulator.score().speed_ratios_pct
    assert len(expected) >= 15
    assert ratios == pytest.approx((*expected, round(100.0 * mine / theirs, 2)), abs=0.02)


def test_the_last_value_of_an_empty_road_is_a_hundred() -> None:
    score = glide("DynamicObjectCrossing")
    assert set(score.speed_ratios_pct) == {100.0}
    assert len(score.speed_ratios_pct) >= 16


_WANTED = ("SignalizedJunctionLeftTurn", "MergerIntoSlowTraffic", "ParkingExit", "InterurbanActorFlow")


@functools.cache
def worlds() -> list[World]:
    return [World(route, seed=0) for route in named_routes("one-per-scenario") if route.scenario.type in _WANTED]


@uncached_entry
def found(world: WorldArrays, x: float, y: float, last: int) -> tuple[int, float, float]:
    return nearest_lane(world, x, y, last)


@settings(max_examples=200, deadline=None)
@given(
    world=st.deferred(lambda: st.sampled_from(worlds())),
    row=st.integers(0, 10**6),
    ahead_m=st.floats(-40.0, 40.0),
    right_m=st.one_of(st.floats(-8.0, 8.0), st.floats(-900.0, 900.0)),
)
def test_what_was_nearest_before_changes_nothing(world: World, row: int, ahead_m: float, right_m: float) -> None:
    statics = world.statics
    x, y, heading = statics.lanes[row % len(statics.lanes)]
    x += ahead_m * np.cos(heading) - right_m * np.sin(heading)
    y += ahead_m * np.sin(heading) + right_m * np.cos(heading)
    away = np.sqrt((x - statics.lanes[:, 0]) ** 2 + (y - statics.lanes[:, 1]) ** 2)
    nearest = found(world._arrays, x, y, -1)
    assert away[statics.lane_of == nearest[0]].min() <= away.min() + 1e-9
    for last in sorted(set(statics.lane_of.tolist())):
        assert found(world._arrays, x, y, last) == nearest
