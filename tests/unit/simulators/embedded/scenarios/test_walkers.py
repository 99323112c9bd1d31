"""Somebody steps out: when they do it, and who gets through."""

from __future__ import annotations

import math

import pytest
from scenario_driver import actors_of, away_m, beside_route, collisions, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c

STEPPING_OUT = ("DynamicObjectCrossing", "ParkingCrossingPedestrian")
CROSSINGS = (*STEPPING_OUT, "PedestrianCrossing", "VehicleTurningRoute", "VehicleTurningRoutePedestrian")


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
    side = math.copysign(1.0, beside_route(world, walkers[0])[1])  # they may come from either
    assert all(side * beside_route(world, k)[1] > world.stage.lane_width_m / 2.0 - 0.3 for k in walkers)
    drive(world, 20.0, speed_mps=0.0)
    assert all(side * beside_route(world, k)[1] < -world.stage.lane_width_m / 2.0 for k in walkers)


@pytest.mark.parametrize("number", range(4))
def test_a_pedestrian_behind_a_turn_comes_from_its_outer_side(number: int) -> None:
    world = staged("VehicleTurningRoutePedestrian", number)
    (walker,) = actors_of(world, ActorKind.PEDESTRIAN)
    assert beside_route(world, walker)[1] * world.stage.first_passage().turn_rad < 0.0


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
