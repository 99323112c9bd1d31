"""Somebody takes the right of way of the ego."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scenario_driver import away_m, beside_route, collisions, drawn, drive, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.generate import all_sites
from pytest_drive_robust.simulators.embedded.world import World

FULL_BRAKE = Control(brake=1.0)
TAKERS = ("OppositeVehicleRunningRedLight", "OppositeVehicleTakingPriority")


# --- who takes the right of way ---


def runner_of(world: World) -> int:
    return next(k for k in range(len(world.state.actor_ints)) if world.state.actor_ints[k, c.I_SEES] == c.SEES_NOBODY)


@pytest.mark.parametrize("name", TAKERS)
@pytest.mark.parametrize("speed_mps", [5.0, 8.0, 11.0])
def test_who_does_not_react_is_hit_or_missed_by_a_hair(name: str, speed_mps: float) -> None:
    for number in range(len(all_sites()[name])):
        world = World(drawn(name, number), seed=0)
        runner, nearest = runner_of(world), math.inf
        while world.state.criteria_ints[c.CI_PROGRESS] < len(world.dense.rows) - 5 and not collisions(world):
            drive(world, 0.05, speed_mps=speed_mps)
            nearest = min(nearest, away_m(world, runner))
        assert collisions(world) == [runner] or nearest < 12.0
        if speed_mps > 7.0 and "straight" in all_sites()[name][number].chain:
            assert collisions(world) == [runner]


@pytest.mark.parametrize("name", TAKERS)
def test_who_brakes_within_a_second_stays_clear(name: str) -> None:
    for number in range(len(all_sites()[name])):
        world = World(drawn(name, number), seed=0)
        runner = runner_of(world)
        assert drive(world, 30.0, speed_mps=9.0, until=lambda w: bool(w.state.actors[runner_of(w), c.A_V] > 0.0))
        drive(world, 0.8, speed_mps=9.0)
        drive(world, 4.0, speed_mps=0.0)
        assert collisions(world) == []
        assert world.state.actor_ints[runner, c.I_ACTIVE] == 1 or world.state.actors[runner, c.A_ALONG_M] > 0.0


def test_the_runner_waits_until_the_ego_is_near_and_does_sixty() -> None:
    world = staged("OppositeVehicleRunningRedLight")
    runner, fastest = runner_of(world), 0.0
    while world.state.actors[runner, c.A_V] == 0.0:
        assert drive(world, 0.05, speed_mps=8.0) is False
        assert world.state.clock[c.TICK] < 400
    assert 8.0 < away_m(world, runner) < 60.0
    for _ in range(60):
        world.tick(FULL_BRAKE)
        fastest = max(fastest, float(world.state.actors[runner, c.A_V]))
    assert fastest == pytest.approx(60.0 / 3.6, rel=0.03)


def test_the_runner_comes_from_where_the_route_file_says() -> None:
    route = drawn("OppositeVehicleTakingPriority")
    sides = {}
    for direction in ("left", "right"):
        spec = replace(route.scenario, texts={"direction": direction})
        world = World(replace(route, scenario=spec), seed=0)
        sides[direction] = beside_route(world, runner_of(world))[1]
    assert sides["left"] < -8.0
    assert sides["right"] > 8.0


def test_a_direction_that_no_road_comes_from_is_refused() -> None:
    route = drawn("OppositeVehicleTakingPriority")
    spec = replace(route.scenario, texts={"direction": "behind"})
    with pytest.raises(RouteError, match=r"'behind'.*left, right, opposite"):
        World(replace(route, scenario=spec), seed=0)
