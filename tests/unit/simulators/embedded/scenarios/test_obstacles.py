"""Something takes the lane: who has to leave it, and who gets through."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scenario_driver import actors_of, beside_route, collisions, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS

ONE_WAY = ("Accident", "ConstructionObstacle", "ParkedObstacle", "HazardAtSideLane")
TWO_WAYS = ("AccidentTwoWays", "ConstructionObstacleTwoWays", "ParkedObstacleTwoWays", "HazardAtSideLaneTwoWays")
VEHICLES = (ActorKind.CAR, ActorKind.VAN, ActorKind.EMERGENCY)
EGO_HALF_M = 0.92


@pytest.mark.parametrize("name", [*ONE_WAY, *TWO_WAYS])
def test_something_blocks_the_lane_and_leaves_the_one_to_the_left_free(name: str) -> None:
    world = staged(name)
    half_lane = world.stage.lane_width_m / 2.0
    left_edges = []
    for k in range(len(world.state.actors)):
        if world.state.actor_ints[k, c.I_FLOW] < 0:
            _, right = beside_route(world, k)
            row = world.state.actors[k]
            turned = abs(math.sin(row[c.A_TURNED])) * row[c.A_LENGTH] + math.cos(row[c.A_TURNED]) * row[c.A_WIDTH]
            left_edges.append(right - turned / 2.0)
    assert -half_lane <= min(left_edges) < EGO_HALF_M


@pytest.mark.parametrize("name", [*ONE_WAY, *TWO_WAYS])
def test_who_only_follows_the_lane_runs_into_the_obstacle(name: str) -> None:
    world = staged(name)
    drive(world, 15.0, speed_mps=9.0)
    hit = collisions(world)
    assert len(hit) > 0
    assert all(world.state.actor_ints[k, c.I_FLOW] < 0 for k in hit)


@pytest.mark.parametrize("name", [*ONE_WAY, *TWO_WAYS])
def test_the_lane_to_the_left_is_in_use(name: str) -> None:
    world = staged(name)
    assert (SCENARIOS[name].two_ways != c.TWO_WAYS_NEVER) == (name in TWO_WAYS)
    headings = set()
    for k in np.flatnonzero((world.state.actor_ints[:, c.I_FLOW] >= 0) & (world.state.actor_ints[:, c.I_ACTIVE] == 1)):
        ahead, right = beside_route(world, int(k))
        if abs(right + world.stage.lane_width_m) < 1.0 and -50.0 < ahead < 250.0:
            headings.add(bool(math.cos(world.state.actors[k, c.A_YAW] - world.state.ego[c.EGO_YAW]) > 0.0))
    assert headings == {name in ONE_WAY}


def test_an_accident_is_a_police_car_and_two_crashed_cars_behind_it() -> None:
    world = staged("Accident", distance=42.0)
    placed = actors_of(world, *VEHICLES)
    assert [world.state.actor_ints[k, c.I_KIND] for k in placed] == [ActorKind.EMERGENCY, ActorKind.CAR, ActorKind.CAR]
    assert [beside_route(world, k)[0] for k in placed] == pytest.approx([42.0, 52.0, 58.0], abs=0.5)


def test_a_building_site_cannot_be_driven_through() -> None:
    world = staged("ConstructionObstacle")
    kinds = [int(world.state.actor_ints[k, c.I_KIND]) for k in actors_of(world, *ActorKind)]
    assert kinds.count(ActorKind.CONE) == 7
    assert kinds.count(ActorKind.WARNING_SIGN) == kinds.count(ActorKind.BARRIER) == 1
