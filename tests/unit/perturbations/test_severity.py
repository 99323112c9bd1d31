from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.errors import PerturbationError, UsageError
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    SpeedNoise,
)
from pytest_drive_robust.perturbations.severity import whole_ticks


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: InferenceLatency(ms=-100), "InferenceLatency: ms is -100, expected milliseconds of at least 0"),
        (lambda: InferenceLatency(), "InferenceLatency: ms is None, expected milliseconds"),
        (lambda: InferenceLatency(ms=100, mode="holt"), "mode is 'holt', expected one of 'fifo', 'hold', 'measured'"),
        (lambda: InferenceLatency(ms=100, mode="holt"), "Did you mean 'hold'?"),
        (lambda: InferenceLatency(ms=100, mode="measured"), "for a fixed latency use mode='hold'"),
        (lambda: InferenceLatency(ms=100, replay_s=(0.1,)), "replay_s is (0.1,), expected none"),
        (lambda: InferenceLatency(mode="measured", replay_s=(-0.1,)), "expected a tuple of seconds of at least 0"),
        (lambda: InferenceLatency(mode="measured", replay_s="fast"), "expected a tuple of seconds of at least 0"),
        (lambda: InferenceLatency(mode="measured", replay_s=0.1), "expected a tuple of seconds of at least 0"),
        (lambda: InferenceLatency(ms=100, warmup_ticks=-1), "warmup_ticks is -1, expected a whole number"),
        (lambda: InferenceLatency(ms=100, warmup_ticks=2.5), "warmup_ticks is 2.5, expected a whole number"),
        (lambda: InferenceLatency(ms="200"), "ms is '200', expected milliseconds"),
        (lambda: InferenceLatency(ms=True), "ms is True, expected milliseconds"),
        (lambda: InferenceLatency(ms=10**309), "000, expected milliseconds of at least 0"),
        (lambda: FrameBlend(frames=10**309), "000, expected a whole number of frames"),
        (lambda: InferenceLatency(mode="measured", replay_s=(10**309,)), "expected a tuple of seconds of at least 0"),
        (lambda: PartialObservation(ratio=1.5), "PartialObservation: ratio is 1.5, expected a share in 0..1"),
        (lambda: PartialObservation(ratio=-0.1), "ratio is -0.1"),
        (lambda: PartialObservation(ratio=math.nan), "ratio is nan"),
        (lambda: PartialObservation(fill="blurr"), "Did you mean 'blur'?"),
        (lambda: PartialObservation(area=1), "area is 1, expected True or False"),
        (
            lambda: GpsNoise(std_m=-5),
            "GpsNoise: std_m is -5, expected metres of at least 0 (the paper drives 5 and 15)",
        ),
        (lambda: GpsNoise(std_m=None), "std_m is None"),
        (lambda: SpeedNoise(mean=-0.2), "mean is -0.2, expected a factor of at least 0"),
        (lambda: SpeedNoise(std=math.nan), "std is nan"),
        (lambda: SpeedNoise(clip="yes"), "clip is 'yes', expected True or False"),
        (lambda: BurstFrameDrop(length_s=0), "length_s is 0, expected seconds above 0"),
        (lambda: BurstFrameDrop(probability=1.1), "probability is 1.1, expected a probability in 0..1"),
        (lambda: BurstFrameDrop(length="unifrom"), "Did you mean 'uniform'?"),
        (lambda: SensorDelay(camera_ms=-1), "camera_ms is -1, expected milliseconds of at least 0"),
        (lambda: SensorDelay(ego_ms=-1), "ego_ms is -1"),
        (lambda: FrameBlend(frames=0), "frames is 0, expected a whole number of frames of at least 1"),
        (lambda: FrameBlend(weights="quadratic"), "weights is 'quadratic', expected one of 'uniform', 'linear'"),
    ],
)
def test_what_no_sensor_and_no_computer_can_have_is_refused(build: Callable[[], Perturbation], message: str) -> None:
    with pytest.raises(PerturbationError, match=re.escape(message)) as caught:
        build()
    assert isinstance(caught.value, UsageError)


def test_numbers_of_numpy_are_kept_as_plain_ones() -> None:
    perturbation = InferenceLatency(ms=np.float32(200), warmup_ticks=np.int64(20))
    assert (type(perturbation.ms), type(perturbation.warmup_ticks)) == (float, int)
    assert perturbation == InferenceLatency(ms=200, warmup_ticks=20)


@given(st.integers(0, 100_000), st.sampled_from([0.05, 0.1, 0.02, 1 / 30, 0.025, 0.01]))
def test_a_multiple_of_the_tick_is_that_many_ticks(ticks: int, dt_s: float) -> None:
    assert whole_ticks(ticks * dt_s, dt_s) == ticks
    assert whole_ticks((ticks + 0.9) * dt_s, dt_s) == ticks
