from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stream_factory import flat_pixels, observation_at, started

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError, UsageError
from pytest_drive_robust.perturbations import (
    BUILTIN,
    BurstFrameDrop,
    EpisodeContext,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    Setting,
    SpeedNoise,
)

FULL_STACK = (
    SensorDelay(camera_ms=50)
    + FrameBlend(frames=3)
    + BurstFrameDrop(length_s=0.3, probability=0.1)
    + PartialObservation(ratio=0.5)
    + PartialObservation(ratio=0.3, fill="blur")
    + GpsNoise(std_m=5)
    + SpeedNoise(mean=0.2)
    + InferenceLatency(ms=100)
)


@given(st.integers(0, 10_000), st.floats(0, 1), st.floats(-1, 1), st.floats(0, 1))
def test_the_clean_stack_gives_back_the_very_objects_that_it_gets(
    tick: int, throttle: float, steer: float, brake: float
) -> None:
    stack = started(Setting.CLEAN)
    observation, control = observation_at(tick), Control(throttle, steer, brake)
    assert stack.observe(observation) is observation
    assert stack.wants_inference(tick)
    assert stack.actuate(tick, control, 0.1) is control
    assert stack.schedule() == ()
    assert (Setting.CLEAN.warmup_ticks, Setting.CLEAN.measures_inference, stack.inference_s) == (0, False, ())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.text(max_size=5))
def test_no_perturbation_writes_into_what_it_gets(seed: int, route_id: str) -> None:
    stack = started(FULL_STACK, seed=seed, route_id=route_id)
    for tick in range(12):
        buffer = np.random.default_rng(tick).integers(0, 256, (20, 30, 3), dtype=np.uint8)
        before = buffer.copy()
        buffer.setflags(write=False)
        given_observation = observation_at(tick, cameras=("front", "rear"), pixels=buffer)
        stack.observe(given_observation)
        assert np.array_equal(buffer, before)
        assert given_observation.cameras["front"].pixels is buffer


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.text(max_size=5))
def test_the_same_episode_gives_the_same_observations(seed: int, route_id: str) -> None:
    first, second = (started(FULL_STACK, seed=seed, route_id=route_id) for _ in range(2))
    for tick in range(12):
        one, two = first.observe(observation_at(tick)), second.observe(observation_at(tick))
        assert (one.gps, one.speed) == (two.gps, two.speed)
        assert np.array_equal(one.cameras["front"].pixels, two.cameras["front"].pixels)
    assert first.schedule() == second.schedule()


def test_episodes_at_the_same_time_do_not_disturb_each_other() -> None:
    alone = started(FULL_STACK, seed=1)
    expected = [alone.observe(observation_at(tick)).gps for tick in range(10)]
    here, beside = started(FULL_STACK, seed=1), started(FULL_STACK, seed=2)
    mixed = []
    for tick in range(10):
        beside.observe(observation_at(tick))
        mixed.append(here.observe(observation_at(tick)).gps)
    assert mixed == expected


@pytest.mark.parametrize("change", [{"seed": 1}, {"route_id": "2092"}])
def test_another_seed_and_another_route_give_other_noise(change: dict[str, object]) -> None:
    white = observation_at(0, pixels=flat_pixels(255, rows=40, columns=60))
    here = started(FULL_STACK).observe(white)
    there = started(FULL_STACK, **change).observe(white)  # type: ignore[arg-type]
    assert here.gps != there.gps
    assert here.speed != there.speed
    assert not np.array_equal(here.cameras["front"].pixels, there.cameras["front"].pixels)


def test_driving_leaves_the_setting_as_it_was() -> None:
    @dataclass
    class Counting(Perturbation):
        seen: list[int] = field(default_factory=list)
        phrase = "counting"

        def observe(self, observation: Observation) -> Observation:
            self.seen.append(observation.tick)
            return observation

    setting = Setting.of(Counting())
    for _ in range(2):
        started(setting).observe(observation_at(0))
    assert str(setting) == "counting"


def test_perturbations_apply_in_the_order_of_the_stack() -> None:
    @dataclass
    class Adds(Perturbation):
        phrase = "adds"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control:
            assert control is not None
            return Control(control.throttle + 0.25)

    @dataclass
    class Halves(Perturbation):
        phrase = "halves"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control:
            assert control is not None
            return Control(control.throttle / 2)

    given_control = Control(0.5)
    assert started(Adds() + Halves()).actuate(0, given_control, 0.0) == Control(0.375)
    assert started(Halves() + Adds()).actuate(0, given_control, 0.0) == Control(0.5)


def test_a_perturbation_that_gives_no_control_holds_the_last_one() -> None:
    @dataclass
    class Drops(Perturbation):
        phrase = "drops"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return control if tick % 2 else None

    stack = started(Drops())
    applied = [stack.actuate(tick, Control(tick / 10), 0.0).throttle for tick in range(5)]
    assert applied == [0.0, 0.1, 0.1, 0.3, 0.3]


def test_the_agent_is_asked_only_when_all_are_free() -> None:
    @dataclass
    class Busy(Perturbation):
        period: int = 2
        phrase = "busy {period}"

        def wants_inference(self, tick: int) -> bool:
            return tick % self.period == 0

    stack = started(Busy(2) + Busy(3))
    assert [tick for tick in range(13) if stack.wants_inference(tick)] == [0, 6, 12]


@pytest.mark.parametrize("answer", [None, "no", 0.0])
def test_an_answer_that_is_no_truth_value_is_not_taken_for_a_busy_computer(answer: object) -> None:
    @dataclass
    class Forgets(Perturbation):
        phrase = "forgets"

        def wants_inference(self, tick: int) -> bool:
            return answer  # type: ignore[return-value]

    with pytest.raises(
        PerturbationError, match=rf"Forgets\.wants_inference gave {answer!r}, expected True or False: is"
    ):
        started(Forgets()).wants_inference(0)


@pytest.mark.parametrize("no", [False, 0, np.bool_(False), np.int64(0)])
def test_whole_numbers_answer_whether_the_agent_is_asked(no: bool) -> None:
    @dataclass
    class Half(Perturbation):
        phrase = "half"

        def wants_inference(self, tick: int) -> bool:
            return no if tick else type(no)(1)

    stack = started(Half())
    assert (stack.wants_inference(0), stack.wants_inference(1)) == (True, False)


def test_an_observation_that_is_none_names_the_guilty_class() -> None:
    @dataclass
    class Forgets(Perturbation):
        phrase = "forgets"

        def observe(self, observation: Observation) -> Observation:  # type: ignore[empty-body]
            pass

    with pytest.raises(PerturbationError, match=r"Forgets\.observe gave None, expected an Observation"):
        started(Forgets()).observe(observation_at(0))


@pytest.mark.parametrize("ticks", [-1, 1])
def test_an_observation_of_another_tick_names_the_guilty_class(ticks: int) -> None:
    @dataclass
    class Shifts(Perturbation):
        phrase = "shifts"

        def observe(self, observation: Observation) -> Observation:
            return replace(observation, tick=observation.tick + ticks)

    told = rf"Shifts\.observe gave the observation of tick {5 + ticks} in tick 5: give the signals"
    with pytest.raises(PerturbationError, match=told):
        started(Shifts()).observe(observation_at(5))


def test_reset_learns_of_the_episode_and_of_twins_in_the_stack() -> None:
    contexts: list[EpisodeContext] = []

    @dataclass
    class Curious(Perturbation):
        phrase = "curious"

        def reset(self, context: EpisodeContext) -> None:
            contexts.append(context)

        def schedule(self) -> tuple[Injection, ...]:
            return (Injection("curious", "gps", 0, 1),)

    stack = started(Curious() + GpsNoise() + Curious(), route_id="17", seed=4, dt_s=0.1, cameras=("front",))
    assert [context.stream for context in contexts] == ["curious", "curious#2"]
    assert {(context.route_id, context.seed, context.dt_s) for context in contexts} == {("17", 4, 0.1)}
    assert [camera.name for camera in contexts[0].cameras] == ["front"]
    assert len(stack.schedule()) == 2  # the GPS noise has not seen a tick yet


def test_settings_are_equal_by_classes_parameters_and_order() -> None:
    one = PartialObservation(ratio=0.5) + InferenceLatency(ms=100)
    assert one == Setting.of(PartialObservation(ratio=0.5), InferenceLatency(ms=100.0))
    assert hash(one) == hash(Setting.parse(str(one)))
    assert one != InferenceLatency(ms=100) + PartialObservation(ratio=0.5)
    assert one != PartialObservation(ratio=0.5) + InferenceLatency(ms=200)
    assert one != "occlusion 0.5 and 100 ms latency"
    assert {one: 1}[Setting.parse("occlusion 0.5 and 100 ms latency")] == 1


def test_stacks_add_up() -> None:
    left, right = GpsNoise() + SpeedNoise(), InferenceLatency(ms=100) + FrameBlend()
    assert (left + right).perturbations == left.perturbations + right.perturbations
    assert left + Setting.CLEAN == Setting.CLEAN + left == left
    assert GpsNoise() + SpeedNoise() == left
    assert Setting.CLEAN + GpsNoise() == Setting.of(GpsNoise())


def test_clean_is_the_empty_stack() -> None:
    assert Setting.CLEAN.is_clean
    assert str(Setting.CLEAN) == "clean"
    assert Setting() == Setting.of() == Setting.parse("clean") == Setting.CLEAN
    assert not Setting.of(GpsNoise()).is_clean


@pytest.mark.parametrize(
    ("wrong", "message"),
    [(GpsNoise, "the class GpsNoise was given"), ("GPS noise 5 m", "'GPS noise 5 m' was given")],
)
def test_a_setting_is_made_of_perturbation_objects_only(wrong: object, message: str) -> None:
    with pytest.raises(PerturbationError, match=message) as caught:
        Setting.of(wrong)  # type: ignore[arg-type]
    assert isinstance(caught.value, UsageError)


def test_adding_something_else_is_a_type_error() -> None:
    with pytest.raises(TypeError):
        Setting.CLEAN + 5  # type: ignore[operator]


def test_the_built_in_names_are_these() -> None:
    assert set(BUILTIN) == {
        "burst-frame-drop",
        "partial-observation",
        "gps-noise",
        "speed-noise",
        "inference-latency",
        "sensor-delay",
        "frame-blend",
    }
