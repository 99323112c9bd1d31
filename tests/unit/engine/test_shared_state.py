"""What a child writes on the board is what its parent reads, also after the child's death."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.truth import EgoState, WorldState
from pytest_drive_robust.engine.shared_state import Phase, SharedState, shared_file, state_bytes
from pytest_drive_robust.runner.episode.stored_controls import AgentRig
from pytest_drive_robust.testing import FakeSimulator, fake_route

EGO = EgoState(1.5, -2.5, 0.1, 8.25, 0.0, 0.0, 0.0, 4.5, 1.9)
ASKED, APPLIED = Control(0.5, -0.25, 0.0), Control(0.0, 0.0, 1.0)


@pytest.fixture
def boards() -> tuple[SharedState, SharedState]:
    fd = shared_file("test", state_bytes(3))
    ours, theirs = SharedState(fd), SharedState(fd)
    os.close(fd)
    return ours, theirs


def tick(state: SharedState, number: int, applied: Control) -> None:
    simulator = FakeSimulator()
    world = simulator.reset(fake_route(), seed=0, cameras=())
    state.ticked(number, WorldState(number, EGO, world.actors, world.lights), simulator.observe(), applied)


def test_rows_arrive_as_they_were_written(boards: tuple[SharedState, SharedState]) -> None:
    ours, theirs = boards
    theirs.clear()
    theirs.asked = ASKED
    tick(theirs, 0, APPLIED)
    tick(theirs, 1, ASKED)
    rows = ours.rows()
    assert ours.ticks == 2
    np.testing.assert_array_equal(rows[0], [0.5, -0.25, 0.0, 0.0, 0.0, 1.0, 1.5, -2.5, 8.25])
    assert np.isnan(rows[1, :3]).all()


@pytest.mark.parametrize("answer", ["full throttle", Control(throttle=float("nan")), Control(throttle="full")])  # type: ignore[arg-type]
def test_what_is_no_control_is_not_kept(boards: tuple[SharedState, SharedState], answer: object) -> None:
    ours, theirs = boards
    theirs.asked = answer
    tick(theirs, 0, APPLIED)
    assert np.isnan(ours.rows()[0, :3]).all()


def test_more_ticks_than_there_is_room_for_are_left_out(boards: tuple[SharedState, SharedState]) -> None:
    ours, theirs = boards
    for number in range(10):
        tick(theirs, number, APPLIED)
    assert ours.ticks == len(ours.rows()) == 4


def test_the_rig_arrives_as_it_is(boards: tuple[SharedState, SharedState]) -> None:
    ours, theirs = boards
    rig = AgentRig((CameraSpec("front", fov_deg=100.5, width_px=64),), ("cameras", "speed"), privileged=True)
    assert ours.rig() is None
    theirs.equip(rig)
    assert ours.rig() == rig
    theirs.clear()
    assert ours.rig() is None


def test_a_rig_that_is_too_large_is_left_out(boards: tuple[SharedState, SharedState]) -> None:
    ours, theirs = boards
    theirs.equip(AgentRig((CameraSpec("x" * 100_000),)))
    assert ours.rig() is None


def test_the_agents_time_is_what_passed_in_its_calls(boards: tuple[SharedState, SharedState]) -> None:
    ours, theirs = boards
    theirs.clear()
    theirs.phase("act", 0)
    begun = ours.read()
    assert begun.phase is Phase.ACT
    assert begun.since_s <= time.monotonic()
    time.sleep(0.02)
    theirs.phase("sim", 0)
    time.sleep(0.02)
    theirs.phase("act", 1)
    now = ours.read()
    assert (now.phase, now.tick) == (Phase.ACT, 1)
    assert 0.02 <= now.agent_s <= now.since_s - begun.since_s - 0.02


def test_nonsense_on_the_board_is_no_phase(boards: tuple[SharedState, SharedState]) -> None:
    ours, theirs = boards
    theirs._memory[:64] = b"\xff" * 64
    theirs._memory[8:32] = bytes(24)
    assert ours.read().phase is Phase.IDLE
    assert ours.ticks == 4
