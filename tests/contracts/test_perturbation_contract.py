"""check_perturbation finds each kind of broken promise, and every built-in keeps them all."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    EpisodeContext,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    SpeedNoise,
)
from pytest_drive_robust.testing import ContractReport, check_perturbation


def failed(report: ContractReport) -> list[str]:
    assert not report.ok
    return [check.name for check in report.checks if not check.ok]


@pytest.mark.parametrize(
    "perturbation",
    [
        BurstFrameDrop(length_s=1),
        PartialObservation(ratio=0.5),
        PartialObservation(ratio=0.8, fill="blur"),
        GpsNoise(std_m=5),
        SpeedNoise(mean=0.2),
        InferenceLatency(ms=200),
        InferenceLatency(ms=200, mode="hold"),
        SensorDelay(camera_ms=100),
        FrameBlend(frames=3),
    ],
    ids=str,
)
def test_every_builtin_keeps_the_contract(perturbation: Perturbation) -> None:
    report = check_perturbation(perturbation)
    assert report.ok, str(report)


@dataclass
class Dimmed(Perturbation):
    gain: float = 0.5
    phrase = "dimmed camera {gain}"

    def observe(self, observation: Observation) -> Observation:
        return observation.map_images(lambda name, image: Image((image.pixels * self.gain).astype("uint8"), image.tick))


def test_a_users_own_keeps_the_contract() -> None:
    report = check_perturbation(Dimmed(gain=0.25))
    assert report.ok, str(report)
    assert [check.name for check in report.checks] == [
        "class",
        "sentence",
        "drives",
        "isolation",
        "observations",
        "controls",
        "determinism",
    ]


def test_a_class_that_forgot_the_dataclass_line_is_found() -> None:
    class Bare(Perturbation):
        phrase = "bare"

    assert failed(check_perturbation(Bare())) == ["class"]


def test_a_class_without_a_phrase_is_found() -> None:
    @dataclass
    class Nameless(Perturbation):
        gain: float = 0.5

    assert "no phrase" in check_perturbation(Nameless())["class"].sentence


def test_writing_into_the_argument_is_found() -> None:
    @dataclass
    class Painter(Perturbation):
        phrase = "painter"

        def observe(self, observation: Observation) -> Observation:
            observation.cameras["front"].pixels[:4] = 0
            return observation

    assert "isolation" in failed(check_perturbation(Painter()))


def test_a_changed_image_type_is_found() -> None:
    @dataclass
    class Floating(Perturbation):
        phrase = "floating"

        def observe(self, observation: Observation) -> Observation:
            return observation.map_images(lambda name, image: Image(image.pixels / 255.0, image.tick))  # type: ignore[arg-type]

    report = check_perturbation(Floating())
    assert failed(report) == ["observations"]
    assert "uint8 to (18, 32, 3) float64" in report["observations"].sentence


def test_a_lost_camera_is_found() -> None:
    @dataclass
    class Unplugged(Perturbation):
        phrase = "unplugged"

        def observe(self, observation: Observation) -> Observation:
            return replace(observation, cameras={})

    assert failed(check_perturbation(Unplugged())) == ["observations"]


def test_randomness_from_elsewhere_is_found() -> None:
    source = itertools.count()

    @dataclass
    class Jitter(Perturbation):
        phrase = "jitter"

        def observe(self, observation: Observation) -> Observation:
            return replace(observation, gps=replace(observation.gps, x_m=float(next(source))))

    assert failed(check_perturbation(Jitter())) == ["determinism"]


def test_what_an_earlier_episode_left_behind_is_found() -> None:
    seeds: list[int] = []

    @dataclass
    class Ageing(Perturbation):
        phrase = "ageing"

        def reset(self, context: EpisodeContext) -> None:
            seeds.append(context.seed)

        def observe(self, observation: Observation) -> Observation:
            return replace(observation, gps=replace(observation.gps, x_m=float(len(set(seeds)))))

    assert failed(check_perturbation(Ageing())) == ["determinism"]


def test_an_impossible_control_is_found() -> None:
    @dataclass
    class Overdrive(Perturbation):
        phrase = "overdrive"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return None if control is None else replace(control, throttle=2.0)

    assert failed(check_perturbation(Overdrive())) == ["controls"]


def test_an_exception_is_told_with_its_line() -> None:
    @dataclass
    class Broken(Perturbation):
        phrase = "broken"

        def observe(self, observation: Observation) -> Observation:
            raise LookupError("lens")

    sentence = check_perturbation(Broken())["drives"].sentence
    assert "LookupError: lens" in sentence
    assert "test_perturbation_contract.py" in sentence
