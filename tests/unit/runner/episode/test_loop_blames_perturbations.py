"""What a perturbation does wrong is blamed on it, and on neither the agent nor the world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import pytest
from episode_loop import CAMERA, FULL, by_speed, drive

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    EpisodeContext,
    FrameBlend,
    Perturbation,
    SensorDelay,
    Setting,
)
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent


@pytest.mark.parametrize("method", ["reset", "observe", "wants_inference", "actuate"])
def test_a_perturbation_that_raises_is_blamed_and_neither_the_agent_nor_the_world(method: str) -> None:
    def short(*given: object) -> None:
        raise OSError("short circuit")

    failure = type("Short", (Perturbation,), {method: short})
    result = drive(ScriptedAgent([FULL]), setting=Setting.of(failure()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert result.end_detail.startswith("a perturbation raised OSError: short circuit (")
    assert "test_loop_blames_perturbations.py" in result.end_detail


def test_a_perturbation_that_invents_an_impossible_control_is_not_blamed_on_the_agent() -> None:
    @dataclass
    class Runaway(Perturbation):
        phrase = "runaway"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return Control(throttle=float("nan"))

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Runaway()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "the perturbations gave the vehicle" in result.end_detail


def test_a_perturbation_that_gives_the_vehicle_something_else_is_named() -> None:
    class Tuple(Perturbation):
        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return (0.0, 0.0, 0.0)  # type: ignore[return-value]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Tuple()))
    assert result.end is End.SIMULATION_CRASHED
    assert "the perturbations gave the vehicle (0.0, 0.0, 0.0), expected a Control or None" in result.end_detail


@pytest.mark.parametrize(
    ("pixels", "told"),
    [
        (
            lambda image: image * 0.5,
            r"gave pixels (9, 16, 3) float64 for the camera 'front', expected (9, 16, 3) uint8",
        ),
        (lambda image: image[1:], "gave pixels (8, 16, 3) uint8 for the camera 'front', expected (9, 16, 3) uint8"),
    ],
)
def test_a_perturbation_that_spoils_an_image_is_named_and_not_the_agent(
    pixels: Callable[[Any], Any], told: str
) -> None:
    class Spoiling(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            return observation.map_images(lambda name, image: Image(pixels(image.pixels), image.tick))

    result = drive(ScriptedAgent([FULL], cameras=(CAMERA,)), setting=Setting.of(Spoiling()))
    assert result.end is End.SIMULATION_CRASHED
    assert told in result.end_detail


@pytest.mark.parametrize(
    "before",
    [
        Setting.CLEAN,
        Setting.of(BurstFrameDrop(length_s=1.0, probability=1.0)),
        Setting.of(SensorDelay(camera_ms=100)),
        Setting.of(FrameBlend(frames=2)),
    ],
    ids=str,
)
def test_a_perturbation_that_writes_into_an_image_which_is_given_again_is_told_where(before: Setting) -> None:
    class Dimming(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            if observation.tick == 2:
                observation.cameras["front"].pixels[:] //= 2
            return observation

    slow = CameraSpec("front", width_px=16, height_px=9, rate_hz=5.0)
    result = drive(ScriptedAgent([FULL], cameras=(slow,)), setting=before + Dimming())
    assert (result.end, result.ticks) == (End.SIMULATION_CRASHED, 2)
    assert "ValueError: output array is read-only (" in result.end_detail
    assert "test_loop_blames_perturbations.py:" in result.end_detail


def test_a_perturbation_that_loses_a_camera_is_named() -> None:
    class Losing(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            return replace(observation, cameras={})

    result = drive(ScriptedAgent([FULL], cameras=(CAMERA,)), setting=Setting.of(Losing()))
    assert result.end is End.SIMULATION_CRASHED
    assert "Losing.observe gave images of [], expected those of ['front']" in result.end_detail


def test_an_observation_of_another_tick_is_blamed_on_the_perturbation_that_kept_it() -> None:
    class Late(Perturbation):
        def reset(self, context: EpisodeContext) -> None:
            self.kept: list[Observation] = []

        def observe(self, observation: Observation) -> Observation:
            self.kept.append(observation)
            return self.kept[max(observation.tick - 5, 0)]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Late()))
    assert (result.end, result.ticks) == (End.SIMULATION_CRASHED, 1)
    assert "Late.observe gave the observation of tick 0 in tick 1: give the signals" in result.end_detail


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda seen: replace(seen, gps=replace(seen.gps, x_m=float("nan"))), "gps.x_m is nan, expected a finite"),
        (lambda seen: replace(seen, speed=replace(seen.speed, mps="fast")), "speed.mps is 'fast', expected a finite"),
        (lambda seen: replace(seen, imu=None), "imu is None, expected a Imu"),
    ],
)
def test_a_signal_that_is_none_is_blamed_on_the_perturbation_or_the_world_that_gave_it(
    change: Callable[[Observation], Any], told: str
) -> None:
    class Losing(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            return change(observation) if observation.tick >= 20 else observation

    class Lost(FakeSimulator):
        def observe(self) -> Observation:
            return change(super().observe()) if self._tick >= 20 else super().observe()

    perturbed = drive(ScriptedAgent(by_speed), setting=Setting.of(Losing()))
    assert (perturbed.end, perturbed.ticks) == (End.SIMULATION_CRASHED, 20)
    assert f"Losing.observe gave an observation whose {told}" in perturbed.end_detail
    result = drive(ScriptedAgent(by_speed), simulator=Lost())
    assert (result.end, result.ticks) == (End.SIMULATION_CRASHED, 20)
    assert f"observe() gave an observation whose {told}" in result.end_detail


def test_what_was_injected_is_checked_before_it_is_stored() -> None:
    class Noting(Perturbation):
        def schedule(self) -> Any:
            return [{"signal": "gps"}]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Noting()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "schedule() of a perturbation gave {'signal': 'gps'}, expected Injection objects" in result.end_detail


def test_what_was_injected_is_named_where_it_cannot_be_stored() -> None:
    class Noting(Perturbation):
        def schedule(self) -> Any:
            return (Injection("noting", "gps", 0, 1.5),)  # type: ignore[arg-type]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Noting()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "cannot be stored, schedule: last_tick: expected a whole number" in result.end_detail
