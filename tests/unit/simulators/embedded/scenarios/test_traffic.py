"""An emergency vehicle wants to pass."""

from __future__ import annotations

import math

import pytest
from scenario_driver import actors_of, away_m, beside_route, drawn, drive

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.embedded.world import World

# --- the emergency vehicle ---


def siren_is_there(world: World) -> bool:
    (siren,) = actors_of(world, ActorKind.EMERGENCY)
    return bool(world.state.actor_ints[siren, c.I_ACTIVE] == 1)


def test_the_emergency_vehicle_comes_from_behind_once_the_scenario_wakes_up() -> None:
    for number in range(len(SCENARIOS["YieldToEmergencyVehicle"].sites)):
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
