"""Traffic ahead stands, and goes on."""

from __future__ import annotations

import pytest
from scenario_driver import actors_of, drive, staged

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c

VEHICLES = (ActorKind.CAR, ActorKind.VAN)


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
