"""The ego leaves a parked row."""

from __future__ import annotations

import math

import pytest
from scenario_driver import actors_of, beside_route, collisions, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.world import World

VEHICLES = (ActorKind.CAR, ActorKind.VAN)


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
