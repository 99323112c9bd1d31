"""Somebody steps out, cuts in, stands still or drives past: when they do it, and who gets through."""

from __future__ import annotations

import math

import pytest
from scenario_driver import actors_of, away_m, beside_route, collisions, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.world import World

STEPPING_OUT = ("DynamicObjectCrossing", "ParkingCrossingPedestrian")
CROSSINGS = (*STEPPING_OUT, "PedestrianCrossing", "VehicleTurningRoute", "VehicleTurningRoutePedestrian")
CUT_INS = ("ParkingCutIn", "StaticCutIn", "HighwayCutIn")
VEHICLES = (ActorKind.CAR, ActorKind.VAN)


@pytest.mark.parametrize("name", CROSSINGS)
def test_nobody_steps_out_while_the_ego_waits(name: str) -> None:
    world = staged(name)
    walkers = actors_of(world, ActorKind.PEDESTRIAN, ActorKind.BICYCLE)
    assert not drive(world, 10.0, speed_mps=0.0, until=lambda w: bool((w.state.actors[walkers, c.A_V] > 0.0).any()))


@pytest.mark.parametrize("name", CROSSINGS)
def test_they_step_out_when_the_ego_arrives_and_end_up_across_the_road(name: str) -> None:
    world = staged(name)
    walkers = actors_of(world, ActorKind.PEDESTRIAN, ActorKind.BICYCLE)
    assert len(walkers) == (3 if name == "PedestrianCrossing" else 1)
    assert drive(world, 20.0, speed_mps=7.0, until=lambda w: bool((w.state.actors[walkers, c.A_V] > 0.0).any()))
    assert min(away_m(world, k) for k in walkers) < 30.0
    assert all(beside_route(world, k)[1] > world.stage.lane_width_m / 2.0 - 0.3 for k in walkers)
    drive(world, 20.0, speed_mps=0.0)
    assert all(beside_route(world, k)[1] < -world.stage.lane_width_m for k in walkers)


@pytest.mark.parametrize("name", STEPPING_OUT)
def test_who_does_not_brake_hits_the_pedestrian(name: str) -> None:
    world = staged(name)
    drive(world, 12.0, speed_mps=9.0)
    assert collisions(world) == actors_of(world, ActorKind.PEDESTRIAN)


@pytest.mark.parametrize("name", CROSSINGS)
def test_who_brakes_at_once_hits_nobody(name: str) -> None:
    world = staged(name)
    walkers = actors_of(world, ActorKind.PEDESTRIAN, ActorKind.BICYCLE)
    drive(world, 20.0, speed_mps=7.0, until=lambda w: bool((w.state.actors[walkers, c.A_V] > 0.0).any()))
    drive(world, 12.0, speed_mps=0.0)
    assert collisions(world) == []


def test_pedestrians_who_cross_at_an_angle_start_nearer_or_farther() -> None:
    places = [beside_route(w, actors_of(w, ActorKind.PEDESTRIAN)[0])[0] for w in (
        staged("DynamicObjectCrossing", distance=45.0, crossing_angle=angle) for angle in (-8.0, 0.0, 8.0)
    )]  # fmt: skip
    assert places[0] < places[1] < places[2]
    assert places[1] == pytest.approx(45.0, abs=0.5)


@pytest.mark.parametrize("name", CUT_INS)
@pytest.mark.parametrize("number", [0, 1, 2])
def test_who_cuts_in_ends_up_ahead_in_the_lane_of_the_ego(name: str, number: int) -> None:
    world = staged(name, number)
    ints = world.state.actor_ints
    (cutter,) = [k for k in actors_of(world, *VEHICLES) if ints[k, c.I_PHASE] == c.PHASE_WAITING]
    speed = 0.7 * world.stage.speed_limit_mps
    assert abs(beside_route(world, cutter)[1]) > 2.0
    assert drive(world, 15.0, speed_mps=speed, until=lambda w: w.state.actor_ints[cutter, c.I_PHASE] >= c.PHASE_SCRIPT)
    drive(world, 1.5, speed_mps=0.6 * speed)
    drive(world, 2.5, speed_mps=0.4 * speed)
    ahead, right = beside_route(world, cutter)
    assert abs(right) < 0.3
    assert ahead > float(world.dense.s[world.state.criteria_ints[c.CI_PROGRESS]]) - world.stage.trigger_m
    assert collisions(world) == []


@pytest.mark.parametrize("number", range(4))
def test_the_blocker_leaves_ten_seconds_after_the_ego_came_near(number: int) -> None:
    world = staged("BlockedIntersection", number)
    (blocker,) = actors_of(world, ActorKind.VAN)
    assert drive(world, 20.0, speed_mps=6.0, until=lambda w: w.state.actor_ints[blocker, c.I_PHASE] == c.PHASE_DELAYED)
    assert not drive(world, 9.5, speed_mps=0.0, until=lambda w: w.state.actors[blocker, c.A_V] > 0.0)
    assert drive(world, 1.0, speed_mps=0.0, until=lambda w: w.state.actors[blocker, c.A_V] > 0.0)


def test_the_blocker_stays_while_the_ego_is_far_away() -> None:
    world = staged("BlockedIntersection")
    (blocker,) = actors_of(world, ActorKind.VAN)
    assert not drive(world, 20.0, speed_mps=0.0, until=lambda w: w.state.actors[blocker, c.A_V] > 0.0)


def test_the_leaders_stand_for_ten_seconds() -> None:
    world = staged("HardBreakRoute")
    leaders = [k for k in actors_of(world, *VEHICLES) if world.state.actor_ints[k, c.I_LEASH] == 1]
    assert drive(
        world, 20.0, speed_mps=6.0, until=lambda w: w.state.actor_ints[leaders[0], c.I_PHASE] == c.PHASE_SCRIPT
    )
    drive(world, 4.0, speed_mps=0.0)
    assert (world.state.actors[leaders, c.A_V] == 0.0).all()
    drive(world, 7.5, speed_mps=0.0)
    assert (world.state.actors[leaders, c.A_V] > 0.0).all()


@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_parked_ego_gets_out_through_a_gap_in_the_traffic(number: int) -> None:
    world = staged("ParkingExit", number)
    ego = world.state.ego
    row = world.dense.rows[0]
    right = -(ego[c.EGO_X] - row[0]) * math.sin(row[2]) + (ego[c.EGO_Y] - row[1]) * math.cos(row[2])
    assert right > world.stage.lane_width_m / 2.0
    traffic = actors_of(world, *VEHICLES, flows=True)

    def free(world: World) -> bool:
        places = [beside_route(world, k) for k in traffic if world.state.actor_ints[k, c.I_ACTIVE] == 1]
        own_lane = [s + world.stage.trigger_m for s, beside in places if abs(beside) < 1.5]
        return world.state.clock[0] > 60 and not any(-32.0 < s < 12.0 for s in own_lane)

    assert drive(world, 60.0, speed_mps=0.0, until=free)
    drive(world, 8.0, speed_mps=5.0)
    assert collisions(world) == []
    assert int(world.state.criteria_ints[c.CI_PROGRESS]) > 15
