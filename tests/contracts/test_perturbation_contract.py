"""check_perturbation finds each kind of broken promise, and every built-in keeps them all."""

from __future__ import annotations

import itertools
import math
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Image, Imu, Observation, Speed
from pytest_drive_robust.domain.result import Injection
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


def test_a_class_in_the_place_of_its_object_is_told_of_the_brackets() -> None:
    (check,) = check_perturbation(GpsNoise)  # type: ignore[arg-type]
    assert check.sentence == "GpsNoise is a class, expected an object of it: add the brackets."


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
        "inference",
        "controls",
        "schedule",
        "seams",
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

    sentence = check_perturbation(Nameless(0.3))["class"].sentence
    assert "has no phrase, so that requirements call it 'nameless (gain=0.3)'" in sentence


def test_a_class_that_changes_nothing_is_found_with_the_method_that_is_meant() -> None:
    @dataclass
    class Sleepy(Perturbation):
        share: float = 0.5
        phrase = "sleepy {share}"

        def observes(self, observation: Observation) -> Observation:
            return observation

    report = check_perturbation(Sleepy())
    assert failed(report) == ["seams"]
    assert "it has none of observe, wants_inference, actuate. Did you mean 'observe'?" in str(report)


def test_a_phrase_that_became_a_severity_is_found() -> None:
    @dataclass
    class Annotated(Perturbation):
        gain: float = 0.5
        phrase: str = "dimmed {gain}"  # type: ignore[misc]

    report = check_perturbation(Annotated(0.6))
    assert failed(report) == ["class"]
    assert "Annotated has 'phrase' as a severity" in report["class"].sentence


def test_an_observation_of_another_tick_is_found() -> None:
    @dataclass
    class Late(Perturbation):
        ticks: int = 5
        phrase = "all late {ticks}"

        def reset(self, context: EpisodeContext) -> None:
            self.kept: deque[Observation] = deque(maxlen=self.ticks + 1)

        def observe(self, observation: Observation) -> Observation:
            self.kept.append(observation)
            return self.kept[0]

    report = check_perturbation(Late(5))
    assert failed(report) == ["observations"]
    assert "tick 1: observe gave the observation of tick 0 in tick 1" in report["observations"].sentence


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
    assert "gave pixels (18, 32, 3) float64 for the camera 'front'" in report["observations"].sentence


@pytest.mark.parametrize(
    ("image", "told"),
    [
        (
            lambda image: Image(image.pixels.tolist(), image.tick),
            "gave pixels as a list for the camera 'front', expected (18, 32, 3) uint8",
        ),
        (lambda image: image.pixels, "gave a ndarray for the camera 'front', expected an Image"),
    ],
)
def test_an_image_that_is_none_is_found(image: Callable[[Image], Image], told: str) -> None:
    @dataclass
    class Listed(Perturbation):
        phrase = "listed"

        def observe(self, observation: Observation) -> Observation:
            return observation.map_images(lambda name, given: image(given))

    report = check_perturbation(Listed())
    assert failed(report) == ["observations"]
    assert told in report["observations"].sentence


def test_an_actuate_that_returns_nothing_is_found() -> None:
    @dataclass
    class Forgets(Perturbation):
        share: float = 0.5
        phrase = "weak brakes {share}"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            if control is not None:
                replace(control, brake=control.brake * self.share)

    report = check_perturbation(Forgets())
    assert failed(report) == ["controls"]
    told = "actuate gave None in all 80 ticks in which it got a control: is there a return in every branch?"
    assert report["controls"].sentence == told


def test_an_actuate_that_drops_some_commands_is_fine() -> None:
    @dataclass
    class Drops(Perturbation):
        phrase = "drops"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return control if tick % 20 == 0 else None

    report = check_perturbation(Drops())
    assert report.ok, str(report)


def test_a_perturbation_that_exits_is_told() -> None:
    @dataclass
    class Exits(Perturbation):
        phrase = "exits"

        def observe(self, observation: Observation) -> Observation:
            sys.exit("no lens")

    assert "SystemExit: no lens" in check_perturbation(Exits())["drives"].sentence


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


def test_a_control_that_is_none_is_tried() -> None:
    @dataclass
    class SteerBias(Perturbation):
        phrase = "steer bias"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return replace(control, steer=0.1)  # type: ignore[type-var]

    report = check_perturbation(SteerBias())
    assert failed(report) == ["drives"]
    assert "where the agent is not asked" in report["drives"].sentence
    assert "actuate gets control=None then" in report["drives"].sentence


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"gps": None}, "gps is None, expected a Gps."),
        ({"compass": 3.0}, "compass is 3.0, expected a Compass."),
        (
            {"speed": Speed(math.nan, 0)},
            "speed.mps is nan, expected a finite number.",
        ),
        (
            {"imu": Imu(0.0, "0", 0.0, 0)},
            "imu.right_mps2 is '0', expected a finite number.",
        ),  # type: ignore[arg-type]
    ],
)
def test_a_signal_that_no_agent_can_take_is_found(changes: dict[str, object], told: str) -> None:
    @dataclass
    class Garbled(Perturbation):
        phrase = "garbled"

        def observe(self, observation: Observation) -> Observation:
            return replace(observation, **changes)  # type: ignore[arg-type]

    report = check_perturbation(Garbled())
    assert failed(report) == ["observations"]
    assert report["observations"].sentence == f"tick 0: observe gave an observation whose {told}"


def test_a_wants_inference_without_a_return_is_found() -> None:
    @dataclass
    class Forgetful(Perturbation):
        phrase = "forgetful"

        def wants_inference(self, tick: int) -> bool:
            tick % 2 == 0  # type: ignore[return]  # noqa: B015

    report = check_perturbation(Forgetful())
    assert failed(report) == ["inference"]
    assert "wants_inference gave None, expected True or False" in report["inference"].sentence


@pytest.mark.parametrize("given", [[{"signal": "gps"}], (("gps", 0, 10),), None])
def test_a_schedule_of_other_things_than_injections_is_found(given: object) -> None:
    @dataclass
    class Scheduled(Perturbation):
        phrase = "scheduled"

        def schedule(self) -> tuple[Injection, ...]:
            return given  # type: ignore[return-value]

    report = check_perturbation(Scheduled())
    assert failed(report) == ["schedule"]
    assert "Injection objects" in report["schedule"].sentence


def test_an_exception_is_told_with_its_line() -> None:
    @dataclass
    class Broken(Perturbation):
        phrase = "broken"

        def observe(self, observation: Observation) -> Observation:
            raise LookupError("lens")

    sentence = check_perturbation(Broken())["drives"].sentence
    assert "LookupError: lens" in sentence
    assert "test_perturbation_contract.py" in sentence


def test_a_phrase_that_no_requirement_can_hold_is_found() -> None:
    @dataclass
    class Numbered(Perturbation):
        number: int = 1
        phrase = "camera #{number} off"

    check = check_perturbation(Numbered())["sentence"]
    assert not check.ok
    assert "can stand in no requirement" in check.sentence


def test_a_failure_that_depends_on_the_wall_time_of_act_is_found() -> None:
    @dataclass
    class Throttled(Perturbation):
        phrase = "hot computer"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return control if inference_s < 0.05 else None

    report = check_perturbation(Throttled())
    assert failed(report) == ["determinism"]
    assert report["determinism"].sentence.startswith("the same episode differs from tick 0 on where act takes longer: ")


def test_a_failure_that_says_that_it_measures_the_wall_time_may_depend_on_it() -> None:
    assert check_perturbation(InferenceLatency(mode="measured")).ok
