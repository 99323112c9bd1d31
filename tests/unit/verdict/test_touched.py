"""A setting that changed nothing is refused, and an agent that uses nothing of what it changed is called immune."""

from __future__ import annotations

from dataclasses import replace

import pytest
from result_factory import make_result

from pytest_drive_robust.domain.result import EpisodeResult, Reception, Touch
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    Setting,
    SpeedNoise,
)
from pytest_drive_robust.verdict.evaluate import evaluate
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.touched import immunity, require_touched


def episodes(
    setting: Setting, *touched: str, count: int = 3, cameras: tuple[str, ...] = (), consumes: tuple[str, ...] = ("gps",)
) -> list[EpisodeResult]:
    """Only the first episode shows a touch."""
    reception = Reception(cameras, consumes, 40)
    results = [replace(make_result(str(number), setting=str(setting)), reception=reception) for number in range(count)]
    touches = tuple(Touch(signal, 5, 2) for signal in touched)
    return [replace(results[0], reception=replace(reception, touched=touches)), *results[1:]]


@pytest.mark.parametrize(
    ("perturbation", "cameras", "reason"),
    [
        (PartialObservation(ratio=0.5), (), "occlusion 0.5: the agent has no camera"),
        (PartialObservation(ratio=0.0), ("front",), "a rectangle of 0 covers nothing .* in the camera front"),
        (BurstFrameDrop(length_s=3), (), "3 s burst frame drop: the agent has no camera"),
        (BurstFrameDrop(probability=0.0), ("front",), r"no burst began \(probability 0 per camera and tick\)"),
        (FrameBlend(frames=1), ("a", "b"), "the mean of 1 frames is the newest one in the cameras a, b"),
        (FrameBlend(), (), "the agent has no camera"),
        (InferenceLatency(ms=20), (), "latency 20 ms is 0 ticks at 20 Hz"),
        (InferenceLatency(ms=100), (), "the agent never gave another command than 2 ticks before"),
        (InferenceLatency(mode="measured"), (), "every inference took less than one tick of 50 ms"),
        (SensorDelay(camera_ms=100, ego_ms=0), (), "the agent has no camera"),
        (SensorDelay(camera_ms=0), (), "a delay of 0 ms is 0 ticks at 20 Hz"),
        (SensorDelay(camera_ms=150), (), "a delay of 150 ms is 3 ticks at 20 Hz"),
        (SensorDelay(camera_ms=0, ego_ms=100), (), "a delay of 100 ms is 2 ticks at 20 Hz"),
        (GpsNoise(std_m=0), (), "noise of 0 m moves no position"),
        (SpeedNoise(mean=1, std=0), (), "a factor of 1 changes no speed"),
        (SpeedNoise(), (), "the vehicle never moved"),
        (SpeedNoise(mean=1), (), "the vehicle never moved"),
        (Perturbation(), (), "leaves every signal and every command as it is"),
    ],
    ids=str,
)
def test_a_setting_that_changed_nothing_is_refused_with_the_reason(
    perturbation: Perturbation, cameras: tuple[str, ...], reason: str
) -> None:
    setting = Setting.of(perturbation)
    with pytest.raises(ComparisonError, match=reason) as error:
        require_touched(setting, episodes(setting, cameras=cameras))
    assert str(error.value).startswith(f"{setting} changed nothing in all 3 episodes of agent 'driver', ")
    assert str(error.value).endswith("; of its sensors it declares to use gps.")


def test_every_member_of_the_stack_gets_its_reason() -> None:
    setting = PartialObservation(ratio=0.5) + GpsNoise(std_m=0)
    told = r"occlusion 0\.5: the agent has no camera\.\n  GPS noise 0 m: noise of 0"
    with pytest.raises(ComparisonError, match=told):
        require_touched(setting, episodes(setting))


def test_one_unlucky_episode_is_no_error() -> None:
    setting = Setting.of(BurstFrameDrop())
    require_touched(setting, episodes(setting, "front", cameras=("front",)))


def test_what_nobody_recorded_is_taken_on_trust() -> None:
    setting = Setting.of(GpsNoise(std_m=0))
    unknown = make_result("9", setting=str(setting))
    require_touched(setting, [unknown])
    require_touched(setting, [*episodes(setting), unknown])


def test_an_episode_that_never_got_under_way_shows_nothing_either_way() -> None:
    setting = Setting.of(GpsNoise(std_m=0))
    require_touched(setting, [replace(result, ticks=0) for result in episodes(setting)])


def test_baselines_have_nothing_to_show() -> None:
    for setting in (Setting.CLEAN, Setting.of(InferenceLatency(ms=0, warmup_ticks=20))):
        require_touched(setting, episodes(setting))


def test_judging_refuses_such_a_setting() -> None:
    setting = Setting.of(PartialObservation(ratio=0.5))
    clean = [replace(result, reception=None) for result in episodes(Setting.CLEAN)]
    with pytest.raises(ComparisonError, match="the agent has no camera"):
        evaluate(requirement("RD", setting) <= 0.3, agent="driver", clean=clean, perturbed=episodes(setting))


def test_an_agent_that_uses_none_of_the_changed_signals_is_called_immune() -> None:
    setting = GpsNoise(std_m=5) + SpeedNoise()
    driven = episodes(setting, "gps", "speed", cameras=("front",), consumes=("cameras",))
    told = (
        "GPS noise 5 m and speed noise 0.5 changed gps, speed, which driver does not use: "
        "the agent has cameras front; of its sensors it declares to use cameras."
    )
    assert immunity(driven) == told
    assert immunity(driven[:1]) == told


@pytest.mark.parametrize(
    ("touched", "consumes"), [("gps", ("gps",)), ("front", ("cameras",)), ("control", ()), ("", ("gps",))]
)
def test_an_agent_that_uses_what_was_changed_is_not(touched: str, consumes: tuple[str, ...]) -> None:
    setting = Setting.of(GpsNoise())
    given = (touched,) if touched else ()
    assert immunity(episodes(setting, *given, cameras=("front",), consumes=consumes)) == ""
