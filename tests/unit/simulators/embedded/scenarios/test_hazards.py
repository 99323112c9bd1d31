"""Something takes part of the lane, or its grip: who gets through."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scenario_driver import actors_of, away_m, beside_route, collisions, control, drive, staged

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.entry_points import pack_world


def test_bicycles_ride_on_for_their_distance_and_then_stand_in_the_way() -> None:
    world = staged("HazardAtSideLaneTwoWays", bicycle_speed=12.0, bicycle_drive_distance=15.0)
    bicycles = actors_of(world, ActorKind.BICYCLE)
    before = [beside_route(world, k)[0] for k in bicycles]
    drive(world, 5.0, speed_mps=0.0)
    assert [beside_route(world, k)[0] for k in bicycles] == before  # they set off when the scenario begins
    assert drive(world, 10.0, speed_mps=4.0, until=lambda w: w.state.clock[c.STARTED] >= 0)
    drive(world, 10.0, speed_mps=0.0)
    after = [beside_route(world, k)[0] for k in bicycles]
    assert np.subtract(after, before) == pytest.approx([15.0, 15.0], abs=0.3)
    assert before[1] - before[0] == pytest.approx(9.0, abs=0.1)
    assert all(world.state.actor_ints[k, c.I_ACTIVE] == 1 and world.state.actors[k, c.A_V] == 0.0 for k in bicycles)


def test_the_door_opens_when_the_ego_is_three_seconds_away() -> None:
    world = staged("VehicleOpensDoorTwoWays", distance=50.0)
    (door,) = actors_of(world, ActorKind.DOOR)
    opened = drive(world, 12.0, speed_mps=9.0, until=lambda w: w.state.actor_ints[door, c.I_ACTIVE] == 1)
    assert opened
    assert 2.5 < away_m(world, door) / world.state.ego[c.EGO_V] < 3.1


def test_the_door_stays_shut_while_nobody_comes() -> None:
    world = staged("VehicleOpensDoorTwoWays", distance=50.0)
    (door,) = actors_of(world, ActorKind.DOOR)
    assert not drive(world, 10.0, speed_mps=0.0, until=lambda w: w.state.actor_ints[door, c.I_ACTIVE] == 1)


@pytest.mark.parametrize(("right_m", "hits"), [(0.0, True), (-1.3, False)])
def test_the_open_door_is_passed_with_a_shift_to_the_left_only(right_m: float, hits: bool) -> None:
    world = staged("VehicleOpensDoorTwoWays", distance=50.0)
    (door,) = actors_of(world, ActorKind.DOOR)
    drive(world, 15.0, speed_mps=8.0, right_m=right_m)
    assert (door in collisions(world)) is hits


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(("right_m", "hits"), [(-0.3, True), (1.0, False)])
def test_oncoming_cars_leave_room_only_for_who_keeps_to_the_right(number: int, right_m: float, hits: bool) -> None:
    world = staged("InvadingTurn", number, offset=0.3)
    drive(world, 25.0, speed_mps=6.0, right_m=right_m)
    assert bool(collisions(world)) is hits


def test_oncoming_cars_are_pushed_aside_as_far_as_in_the_original() -> None:
    """By half a lane and the file's offset, less 0.7 m: about half a metre of the car is over the line."""
    world = staged("InvadingTurn", offset=0.3)
    rights = []
    for _ in range(200):
        world.tick(Control(brake=1.0))
        rights += [beside_route(world, k)[1] for k in actors_of(world, ActorKind.CAR, flows=True)]
    assert max(rights) == pytest.approx(0.3 - 0.7 - world.stage.lane_width_m / 2.0, abs=0.1)


def test_dirt_pulls_the_steering_of_who_drives_over_it() -> None:
    world, clean = staged("ControlLoss"), staged("ControlLoss")
    clean._arrays = pack_world(clean.statics._replace(patches=np.zeros((0, 2))), clean.state)
    for _ in range(400):
        assert np.array_equal(world.state.ego, clean.state.ego)
        near = min(math.dist(world.state.ego[:2], patch) for patch in world.statics.patches)
        chosen = control(world, speed_mps=7.0)
        world.tick(chosen)
        clean.tick(chosen)
        if near < 2.0:
            break
    assert near < 2.0
    assert abs(world.state.ego[c.EGO_STEER] - clean.state.ego[c.EGO_STEER]) > 1e-4


def test_each_patch_pulls_to_a_side_of_its_own_and_pushes_or_holds() -> None:
    signs = set()
    for number in range(5):
        noise = staged("ControlLoss", number).statics.patch_noise
        assert noise.shape[0] == 3
        assert np.abs(noise.mean(axis=1)) == pytest.approx(np.tile([0.03, 0.055], (3, 1)), abs=0.005)
        signs |= {tuple(np.sign(patch.mean(axis=0))) for patch in noise}
    assert len(signs) == 4


def test_three_patches_of_dirt_lie_on_the_way_and_stop_nobody() -> None:
    world = staged("ControlLoss")
    patches = actors_of(world, ActorKind.DIRT)
    assert [beside_route(world, k)[0] for k in patches] == pytest.approx([14.0, 48.0, 74.0], abs=0.5)
    drive(world, 20.0, speed_mps=8.0)
    assert collisions(world) == []
