"""Somebody pulls into the lane of the ego."""

from __future__ import annotations

import math

import pytest
from scenario_driver import actors_of, beside_route, collisions, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c

CUT_INS = ("ParkingCutIn", "StaticCutIn", "HighwayCutIn")
VEHICLES = (ActorKind.CAR, ActorKind.VAN)


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


@pytest.mark.parametrize("speed_mps", [4.0, 6.0, 8.0, 11.0])
@pytest.mark.parametrize("name", ["ParkingCutIn", "StaticCutIn"])
def test_who_drives_on_at_any_speed_meets_the_car_that_cuts_in(name: str, speed_mps: float) -> None:
    world = staged(name)
    ints = world.state.actor_ints
    (cutter,) = [k for k in actors_of(world, *VEHICLES) if ints[k, c.I_PHASE] == c.PHASE_WAITING]
    drive(world, 40.0, speed_mps=speed_mps)
    assert cutter in collisions(world)


def test_the_car_on_the_motorway_keeps_ten_metres_ahead_from_middle_to_middle_and_slows_down_at_once() -> None:
    world = staged("HighwayCutIn")
    ints, actors, ego = world.state.actor_ints, world.state.actors, world.state.ego
    (cutter,) = [k for k in actors_of(world, *VEHICLES) if ints[k, c.I_PHASE] == c.PHASE_WAITING]
    speed = world.stage.start_mps
    drive(world, 15.0, speed_mps=speed, until=lambda w: w.state.actor_ints[cutter, c.I_PHASE] >= c.PHASE_SCRIPT)
    ahead = math.hypot(actors[cutter, c.A_X] - ego[c.EGO_X], actors[cutter, c.A_Y] - ego[c.EGO_Y])
    assert ahead == pytest.approx(math.hypot(10.0, world.stage.lane_width_m), abs=0.5)
    drive(world, 1.0, speed_mps=speed)
    assert actors[cutter, c.A_V] == pytest.approx(0.8 * speed, rel=0.03)
