"""What the loop records of the setting's work at both seams."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.result import Reception, Touch
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    RunningStack,
    SensorDelay,
    Setting,
    SpeedNoise,
)
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.witness import Witness
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route

FRONT = CameraSpec("front", width_px=16, height_px=9)
REAR = CameraSpec("rear", width_px=16, height_px=9, rate_hz=10.0)


@dataclass
class Copied(Perturbation):
    """New memory, old content."""

    phrase = "copied"

    def observe(self, observation: Observation) -> Observation:
        return replace(observation.private(), gps=replace(observation.gps))


def received(*perturbations: Perturbation, cameras: tuple[CameraSpec, ...] = (FRONT, REAR)) -> Reception:
    script = [Control(throttle=0.4 + 0.001 * tick) for tick in range(100)]
    result = drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=60)),
        ScriptedAgent(script, cameras=cameras, consumes=("speed", "cameras")),
        route=fake_route(),
        setting=Setting.of(*perturbations),
        seed=1,
        agent_name="under test",
    )
    assert result.reception is not None
    return result.reception


def test_a_clean_episode_shows_what_the_agent_has_and_no_touch() -> None:
    assert received() == Reception(("front", "rear"), ("cameras", "speed"), 60)


def test_content_counts_not_memory() -> None:
    assert received(Copied()).touched == ()


@pytest.mark.parametrize(
    ("perturbation", "signals"),
    [
        (GpsNoise(std_m=1.0), {"gps": 60}),
        (SpeedNoise(mean=0.5), {"speed": 59}),  # in tick 0 the vehicle stands: half of nothing is nothing
        (PartialObservation(ratio=0.5), {"front": 60, "rear": 60}),
        (SensorDelay(camera_ms=0, ego_ms=50), {"gps": 59, "compass": 59, "imu": 59, "speed": 59}),
        (InferenceLatency(ms=100), {"control": 60}),
        (InferenceLatency(ms=100, mode="hold"), {"control": 60}),
    ],
    ids=str,
)
def test_each_signal_is_counted_in_the_ticks_in_which_it_differed(
    perturbation: Perturbation, signals: dict[str, int]
) -> None:
    touched = received(perturbation).touched
    assert {touch.signal: touch.ticks for touch in touched} == signals
    assert {touch.first_tick for touch in touched} == {60 - max(signals.values())}


def test_bursts_are_counted_as_they_are_scheduled() -> None:
    setting = BurstFrameDrop(length_s=0.5, probability=0.05)
    (touch,) = received(setting, cameras=(FRONT,)).touched
    frozen = RunningStack.of(Setting.of(setting), route_id="1", seed=1, dt_s=0.05, cameras=(FRONT,))
    world = FakeSimulator(SimulatorOptions(tick_cap=60))
    world.reset(fake_route(), seed=1, cameras=(FRONT,))
    stale = []
    for tick in range(60):
        if frozen.observe(world.observe()).cameras["front"].tick != tick:
            stale.append(tick)
        world.step(Control(throttle=0.5))
    assert touch == Touch("front", len(stale), stale[0])


@pytest.mark.parametrize(
    "perturbation",
    [
        GpsNoise(std_m=0.0),
        SpeedNoise(mean=1.0, std=0.0),
        PartialObservation(ratio=0.01),
        FrameBlend(frames=1),
        InferenceLatency(ms=0),
        BurstFrameDrop(probability=0.0),
    ],
    ids=str,
)
def test_severities_that_do_nothing_touch_nothing(perturbation: Perturbation) -> None:
    assert received(perturbation).touched == ()


def test_a_camera_failure_touches_nothing_of_an_agent_without_cameras() -> None:
    reception = received(BurstFrameDrop(), FrameBlend(), PartialObservation(), cameras=())
    assert (reception.cameras, reception.touched) == ((), ())


def test_the_warm_up_is_no_touch_because_the_clean_twin_waits_as_long() -> None:
    assert received(InferenceLatency(ms=0, warmup_ticks=20)).touched == ()


def test_an_observation_that_the_agent_never_got_does_not_count() -> None:
    reception = received(GpsNoise(std_m=1.0), InferenceLatency(ms=500, mode="hold"))
    counts = {touch.signal: touch.ticks for touch in reception.touched}
    assert reception.observations == counts["gps"] == 6


def test_pixels_are_read_until_a_camera_was_seen_to_change_and_never_after(monkeypatch: pytest.MonkeyPatch) -> None:
    compared = []
    equal = np.array_equal
    monkeypatch.setattr(np, "array_equal", lambda *images: compared.append(1) or equal(*images))
    world = FakeSimulator()
    world.reset(fake_route(), seed=0, cameras=(FRONT,))
    captured = world.observe()
    white = captured.map_images(lambda _, image: Image(image.pixels | 255, image.tick))
    witness = Witness()
    for given in (captured, captured.private(), white, white, white):
        witness.seen(captured, given)
    assert len(compared) == 2
    assert witness.reception().touched == (Touch("front", 3, 0),)


def test_a_delayed_image_is_told_by_its_tick_of_capture() -> None:
    assert received(SensorDelay(camera_ms=50, ego_ms=0), cameras=(FRONT,)).touched == (Touch("front", 59, 1),)


def given_table(*perturbations: Perturbation) -> np.ndarray:
    result = drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=60)),
        ScriptedAgent([Control(throttle=0.5)] * 60, cameras=(FRONT, REAR)),
        route=fake_route(),
        setting=Setting.of(*perturbations),
        seed=1,
        agent_name="under test",
    )
    assert result.given is not None
    return result.given.rows


def test_the_record_tells_what_the_agent_was_given_in_each_tick() -> None:
    clean = given_table()
    assert clean.shape == (60, 7)
    assert clean.dtype == np.float32
    assert clean[:, 0].tolist() == list(range(60))
    assert clean[:, 5].tolist() == list(range(60))
    assert clean[:4, 6].tolist() == [0, 0, 2, 2]  # 10 Hz
    noisy = given_table(GpsNoise(std_m=5))
    assert (noisy[:, 1:3] != clean[:, 1:3]).any(axis=1).all()
    assert (noisy[:, 3:] == clean[:, 3:]).all()
    late = given_table(SensorDelay(camera_ms=100))
    assert late[10, 5] == 8


@dataclass
class Numberless(Perturbation):
    phrase = "numberless"

    def observe(self, observation: Observation) -> Observation:
        if observation.tick < 5:
            return observation
        return replace(observation, gps=replace(observation.gps, y_m="south"))  # type: ignore[arg-type]


def test_a_perturbation_that_gives_no_number_is_our_fault_and_leaves_the_rows_before_it() -> None:
    result = drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=60)),
        ScriptedAgent([Control(throttle=0.5)] * 60, cameras=(FRONT,)),
        route=fake_route(),
        setting=Setting.of(Numberless()),
        seed=1,
        agent_name="under test",
    )
    assert result.end is End.SIMULATION_CRASHED
    assert result.given is not None
    assert result.given.rows.shape == (5, 6)
