"""A recorded drive is the drive itself, and the tape holds what a film needs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_drive_robust.domain.agent import PlannedPath
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.replay.recording import Tape, difference, main_camera, record_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, fake_route


class Driver:
    """Steers a little right and says that it means to."""

    def __init__(self, cameras: Sequence[CameraSpec] = (), *, plan: Any = None) -> None:
        self._cameras = cameras
        self._plan = plan
        self.seen: list[Observation] = []

    def sensors(self) -> Sequence[CameraSpec]:
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.seen = []

    def act(self, observation: Observation) -> Control:
        self.seen.append(observation)
        return Control(throttle=1.0, steer=0.02)

    def plan(self) -> PlannedPath:
        if isinstance(self._plan, Exception):
            raise self._plan
        return self._plan or PlannedPath(path=((0.0, 0.0), (10.0, 0.0)), target_points=((10.0, 2.0),))


@contextmanager
def recorded(agent: Any, setting: str = "clean", *, ticks: int = 40, simulator: Any = None) -> Iterator[Tape]:
    tape = record_episode(
        simulator or FakeSimulator(SimulatorOptions(tick_cap=ticks)),
        agent,
        route=fake_route(),
        setting=Setting.parse(setting),
        seed=3,
        agent_name="driver",
    )
    yield tape


@pytest.mark.parametrize("cameras", [(), (CameraSpec("front"),)], ids=["blind", "seeing"])
@pytest.mark.parametrize("setting", ["clean", "200 ms latency", "1 s burst frame drop"])
def test_a_recorded_drive_is_bit_for_bit_the_drive(cameras: tuple[CameraSpec, ...], setting: str) -> None:
    plain = drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=40)),
        Driver(cameras),
        route=fake_route(),
        setting=Setting.parse(setting),
        seed=3,
        agent_name="driver",
    )
    with recorded(Driver(cameras), setting) as tape:
        assert tape.result.trace.digest == plain.trace.digest
        assert tape.result.infractions == plain.infractions
        assert difference(tape.result, plain) == ""


def test_there_is_a_moment_before_every_tick_and_one_at_the_end() -> None:
    with recorded(Driver()) as tape:
        assert [moment.state.tick for moment in tape.moments] == list(range(41))
        speeds = [moment.state.ego.speed_mps for moment in tape.moments[1:]]
        assert speeds == tape.result.trace.column("speed_mps").tolist()
        assert tape.moments[-1].applied is None


def test_an_agent_without_cameras_is_given_none_while_the_film_has_one() -> None:
    agent = Driver()
    with recorded(agent) as tape:
        assert tape.shown_only
        assert tape.images(5)
        assert all(not observation.cameras for observation in agent.seen)


def test_pictures_are_those_that_the_agent_was_given() -> None:
    agent = Driver((CameraSpec("front"),))
    with recorded(agent) as tape:
        for position in (0, 17, 39):
            pixels, tick = tape.images(position)["front"]
            given = agent.seen[position].cameras["front"]
            assert tick == given.tick
            assert np.abs(pixels.astype(int) - given.pixels.astype(int)).mean() < 4.0  # a JPEG of it


def test_a_frozen_camera_keeps_what_was_really_there() -> None:
    with recorded(Driver((CameraSpec("front"),)), "1 s burst frame drop (probability=0.2)") as tape:
        frozen = [k for k, moment in enumerate(tape.moments[:-1]) if tape.images(k)["front"][1] < moment.state.tick]
        changed = [k for k in frozen if k - tape.images(k)["front"][1] > 5 and k > 20]  # driving by then
        assert changed
        assert all(tape.real(k) is not None for k in changed)
        assert tape.real(0) is None


def test_a_wide_image_is_kept_no_wider_than_a_film_shows_it() -> None:
    with recorded(Driver((CameraSpec("front", width_px=1600, height_px=900),)), ticks=3) as tape:
        assert tape.images(1)["front"][0].shape == (360, 640, 3)


def test_the_plan_is_kept_in_the_world_at_the_pose_of_its_making() -> None:
    with recorded(Driver()) as tape:
        for position in (0, 39):
            ego, plan = tape.moments[position].state.ego, tape.moments[position].plan
            assert plan is not None
            assert plan.path[0] == pytest.approx((ego.x_m, ego.y_m))
            ahead = np.array(plan.path[1]) - plan.path[0]
            assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(ego.yaw_rad)
            right = np.array(plan.target_points[0]) - plan.path[1]
            assert np.hypot(*right) == pytest.approx(2.0)
            assert ahead[0] * right[1] - ahead[1] * right[0] > 0.0  # clockwise: y points down


def test_a_held_command_keeps_the_plan_behind_it() -> None:
    with recorded(Driver(), "200 ms latency (mode=hold)") as tape:
        plans = [moment.plan for moment in tape.moments[:5]]
        assert plans[0] is plans[3]


@pytest.mark.parametrize("plan", [RuntimeError("no plan yet"), PlannedPath(path=((float("nan"), 0.0),)), "nonsense"])
def test_a_broken_plan_is_named_and_costs_only_the_overlay(plan: object) -> None:
    with recorded(Driver(plan=plan)) as tape:
        assert tape.result.outcome is not Outcome.AGENT_ERROR
        assert tape.plan_problem.startswith("plan raised")
        assert all(moment.plan is None for moment in tape.moments)


def test_what_was_asked_and_what_the_car_got_are_told_apart() -> None:
    with recorded(Driver(), "200 ms latency") as tape:
        first = tape.moments[0]
        assert first.asked == Control(throttle=1.0, steer=0.02)
        assert first.applied == Control.NEUTRAL


def test_a_world_that_cannot_be_built_has_nothing_to_show() -> None:
    broken = FakeSimulator(raises=RuntimeError("no map"), raises_in="reset")
    with pytest.raises(SimulationError, match=r"nothing to show.*no map"), recorded(Driver(), simulator=broken):
        pass


def test_a_difference_says_from_when_on() -> None:
    with recorded(Driver()) as tape:
        result = tape.result
    rows = result.trace.rows.copy()
    rows[20:, 0] += 1e-12
    assert difference(result, replace(result, trace=replace(result.trace, rows=rows))) == "from 1.05 s on"
    rows = result.trace.rows.copy()
    rows[7, 9] = -rows[7, 9]
    assert rows[7, 9] == 0.0  # the bits differ all the same
    assert difference(result, replace(result, trace=replace(result.trace, rows=rows))) == "from 0.40 s on"
    shorter = replace(result, trace=replace(result.trace, rows=result.trace.rows[:10]), ticks=10)
    assert difference(result, shorter) == "only in length: 2.00 s now, 0.50 s stored"


def test_the_main_camera_is_the_one_named_front_or_the_middle_one() -> None:
    assert main_camera(["left", "right", "front"]) == "front"
    assert main_camera(["left", "centre", "right"]) == "centre"
