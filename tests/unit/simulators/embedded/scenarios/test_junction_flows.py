"""Flows that must be crossed or joined: gaps, speeds, manners."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scenario_driver import collisions, drawn, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.generate import all_sites
from pytest_drive_robust.simulators.embedded.kernels.contacts import overlap
from pytest_drive_robust.simulators.embedded.world import World

Floats = NDArray[np.float64]
FULL_BRAKE = Control(brake=1.0)
FLOWS = (
    "CrossingBicycleFlow", "EnterActorFlow", "HighwayExit", "InterurbanActorFlow", "InterurbanAdvancedActorFlow",
    "MergerIntoSlowTraffic", "MergerIntoSlowTrafficV2", "NonSignalizedJunctionLeftTurn",
    "NonSignalizedJunctionLeftTurnEnterFlow", "NonSignalizedJunctionRightTurn", "SignalizedJunctionLeftTurn",
    "SignalizedJunctionLeftTurnEnterFlow", "SignalizedJunctionRightTurn",
)  # fmt: skip


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
            found.append(members[np.argsort(-world.state.actors[members, c.A_ALONG_M])])
    return found


def gaps_m(world: World, members: NDArray[np.int64]) -> Floats:
    """Middle of one to middle of the next, in metres."""
    rows = world.state.actors[members]
    return np.asarray(rows[:-1, c.A_ALONG_M] - rows[1:, c.A_ALONG_M])


# --- flows ---


@pytest.mark.parametrize("name", FLOWS)
def test_gaps_and_speed_are_those_of_the_route_file(name: str) -> None:
    for number in range(len(all_sites()[name])):
        world = World(drawn(name, number), seed=number)
        spec = world.dense.route.scenario
        low = spec.number("source_dist_interval", math.nan, attribute="from")
        high = spec.number("source_dist_interval", math.nan, attribute="to")
        flows = file_flows(world)
        assert flows
        for members in flows:
            gaps = gaps_m(world, members)
            # every third may be twice as long
            assert gaps.min() >= low - 1e-6
            assert gaps.max() <= 2.0 * max(high, 8.2) + 1e-6
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
    for number in range(len(all_sites()[name])):
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
    before = world.state.actors[:, c.A_ALONG_M].copy()
    slots = world.state.actor_ints[:, c.I_FLOW] == world.state.actor_ints[members[0], c.I_FLOW]
    for _ in range(1000):
        world.tick(FULL_BRAKE)
        now = world.state.actors[:, c.A_ALONG_M]
        passed.extend([world.state.clock[c.TICK] * 0.05] * int((slots & (before < meets) & (now >= meets)).sum()))
        before = now.copy()
    apart = np.diff(passed) * world.state.flows[0, c.F_SPEED]
    ahead_m = world.dense.trigger_m + world.stage.junction_ahead_m()
    early = np.array(passed[1:]) < ahead_m / 4.0 + 8.0  # however slowly they come, and until they are across
    assert apart[early].max() < high + 0.6
    assert apart[~early].max() > high + 0.6


def accel_of(world: World, car: int, *, aside: float, ahead: float = 12.0) -> float:
    """What a driver does about an ego that stands so many metres ahead of him, `aside` beside his line [m/s2]."""
    row = world.state.actors[car]
    yaw = float(row[c.A_YAW])
    world.state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = (
        row[c.A_X] + ahead * math.cos(yaw) - aside * math.sin(yaw),
        row[c.A_Y] + ahead * math.sin(yaw) + aside * math.cos(yaw),
        yaw,
        0.0,
    )
    world.tick(FULL_BRAKE)
    return float(world.state.actors[car, c.A_ACCEL])


def test_cross_traffic_overlooks_who_comes_late_until_he_is_in_the_middle_of_the_lane() -> None:
    world = staged("VanillaNonSignalizedTurn")
    late = np.flatnonzero(
        (world.state.actor_ints[:, c.I_SEES] == c.SEES_LATE) & (world.state.actor_ints[:, c.I_ACTIVE] == 1)
    )
    car = int(late[len(late) // 2])
    assert accel_of(world, car, aside=1.6) == pytest.approx(0.0, abs=0.01)
    assert accel_of(world, car, aside=0.0) < -3.0


@pytest.mark.parametrize("name", FLOWS)
def test_a_flow_gives_way_to_nobody_until_one_of_it_is_hit(name: str) -> None:
    world = staged(name)
    members = file_flows(world)[0]
    hit, follower = int(members[-2]), int(members[-1])
    assert accel_of(world, follower, aside=0.0) == pytest.approx(0.0, abs=0.01)
    row = world.state.actors[hit]
    world.state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = row[c.A_X], row[c.A_Y], row[c.A_YAW] + 1.5, 3.0
    world.tick(FULL_BRAKE)
    assert collisions(world) == [hit]
    assert accel_of(world, follower, aside=0.0) < -3.0


def test_who_comes_late_scrapes_past_an_ego_that_stands_in_the_way_instead_of_blocking_the_road() -> None:
    world = staged("NonSignalizedJunctionLeftTurn")
    car = int(file_flows(world)[0][-2])
    row, start = world.state.actors[car], float(world.state.actors[car, c.A_ALONG_M])
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
    assert world.state.actors[car, c.A_ALONG_M] > start + 25.0


@pytest.mark.parametrize("name", [*FLOWS, "SequentialLaneChange", "T_Junction", "VanillaNonSignalizedTurn"])
def test_traffic_stays_out_of_each_other_where_no_ego_disturbs_it(name: str) -> None:
    for number in range(min(len(all_sites()[name]), 3)):
        world = World(drawn(name, number), seed=1)
        world.state.ego[c.EGO_X] += 1e4
        for _ in range(50):
            for _ in range(8):
                world.tick(FULL_BRAKE)
            cars = world.now().actors[
                :, [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH]
            ]
            for i in range(len(cars)):
                near = np.hypot(cars[:i, 0] - cars[i, 0], cars[:i, 1] - cars[i, 1]) < 8.0
                assert all(overlap(*cars[i], *other)[0] == 0.0 for other in cars[:i][near])


def test_bicycles_ride_on_their_own_lane_beside_the_cars() -> None:
    for number in range(len(all_sites()["CrossingBicycleFlow"])):
        world = World(drawn("CrossingBicycleFlow", number), seed=0)
        assert {int(k) for m in file_flows(world) for k in world.state.actor_ints[m, c.I_KIND]} == {ActorKind.BICYCLE}


def test_two_flows_meet_who_turns_left_onto_a_country_road() -> None:
    world = staged("InterurbanAdvancedActorFlow")
    first, second = file_flows(world)
    yaws = [float(world.state.actors[members[0], c.A_YAW]) for members in (first, second)]
    assert math.cos(yaws[0] - yaws[1]) == pytest.approx(-1.0, abs=0.05)
