"""What a worker writes is what we read, also after its death."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.engine.shared_state import Phase, SharedState, shared_file
from pytest_drive_robust.testing import FakeSimulator, fake_route

ASKED, APPLIED = Control(0.5, -0.25, 0.0), Control(0.0, 0.0, 1.0)
CAMERA = CameraSpec("front", fov_deg=100.5, width_px=64)


@pytest.fixture
def states() -> tuple[SharedState, SharedState]:
    fd = shared_file(3)
    ours, theirs = SharedState(fd), SharedState(fd)
    os.close(fd)
    return ours, theirs


def tick(state: SharedState, number: int, asked: Control | None, applied: Control) -> None:
    simulator = FakeSimulator()
    world = simulator.reset(fake_route(), seed=0, cameras=())
    state.ticked(number, world, simulator.observe(), asked, applied)


def test_what_was_driven_arrives_as_it_was_written(states: tuple[SharedState, SharedState]) -> None:
    ours, theirs = states
    theirs.clear()
    theirs.equip((CAMERA,), ("cameras", "speed"), privileged=True)
    tick(theirs, 0, ASKED, APPLIED)
    tick(theirs, 1, None, ASKED)
    found = ours.recorded()
    assert found is not None
    assert ours.ticks == 2
    assert (found.asked, found.applied) == ((ASKED, None), (APPLIED, ASKED))
    assert (found.cameras, found.consumes, found.privileged) == ((CAMERA,), ("cameras", "speed"), True)


def test_more_ticks_than_there_is_room_for_are_left_out(states: tuple[SharedState, SharedState]) -> None:
    ours, theirs = states
    theirs.equip((), (), privileged=False)
    for number in range(10):
        tick(theirs, number, ASKED, APPLIED)
    found = ours.recorded()
    assert found is not None
    assert ours.ticks == len(found.applied) == 4


def test_of_an_episode_that_did_not_begin_nothing_is_known(states: tuple[SharedState, SharedState]) -> None:
    ours, theirs = states
    assert ours.recorded() is None
    theirs.equip((CAMERA,), (), privileged=False)
    assert ours.recorded() is not None
    theirs.clear()
    assert ours.recorded() is None


def test_an_agent_with_too_many_cameras_is_left_out(states: tuple[SharedState, SharedState]) -> None:
    ours, theirs = states
    theirs.equip((CameraSpec("x" * 100_000),), (), privileged=False)
    assert ours.recorded() is None


def test_the_agents_time_is_what_passed_in_its_calls(states: tuple[SharedState, SharedState]) -> None:
    ours, theirs = states
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


def test_nonsense_is_no_phase_and_no_episode(states: tuple[SharedState, SharedState]) -> None:
    ours, theirs = states
    theirs._memory[:200] = b"\xff" * 200
    theirs._memory[8:32] = bytes(24)
    assert ours.read().phase is Phase.IDLE
    assert ours.ticks == 4
    assert ours.recorded() is None


WRITER = """
import sys
from itertools import count
from pytest_drive_robust.engine.shared_state import SharedState

state = SharedState(int(sys.argv[1]))
for tick in count(1):
    for phase in ("reset", "act", "sim"):
        state.phase(phase, tick)
"""


def test_what_is_read_is_never_half_written() -> None:
    fd = shared_file(3)
    ours, begun_s = SharedState(fd), time.monotonic()
    with subprocess.Popen([sys.executable, "-c", WRITER, str(fd)], pass_fds=(fd,)) as writer:
        try:
            while ours.read().tick == 0:
                assert writer.poll() is None
            read = [ours.read() for _ in range(50_000)]
        finally:
            writer.kill()
            os.close(fd)
    assert [reading for reading in read if reading.since_s < begun_s] == []
