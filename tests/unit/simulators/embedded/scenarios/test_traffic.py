"""Traffic on the ego's own road."""

from __future__ import annotations

import math

import pytest
from scenario_driver import actors_of, away_m, beside_route, collisions, drawn, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.generate import all_sites
from pytest_drive_robust.simulators.embedded.world import World

# --- the emergency vehicle ---


def siren_is_there(world: World) -> bool:
    (siren,) = actors_of(world, ActorKind.EMERGENCY)
    return bool(world.state.actor_ints[siren, c.I_ACTIVE] == 1)


def test_the_emergency_vehicle_comes_from_behind_once_the_scenario_wakes_up() -> None:
    for number in range(len(all_sites()["YieldToEmergencyVehicle"])):
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
        return world.state.clock[c.TICK] > 60 and not any(-32.0 < s < 12.0 for s in own_lane)

    assert drive(world, 60.0, speed_mps=0.0, until=free)
    drive(world, 8.0, speed_mps=5.0)
    assert collisions(world) == []
    assert int(world.state.criteria_ints[c.CI_PROGRESS]) > 15


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
