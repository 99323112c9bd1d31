"""Comfort ("comfortness", smoothness): the share of seconds in which six motion signals stay within bounds.

Source: Bench2Drive `tools/efficiency_smoothness_benchmark.py`; the bounds are nuPlan's. Two modes:

==================== ================ ============================= =====================================
point                quirk            bench2drive (bug-compatible)  fixed
==================== ================ ============================= =====================================
yaw rate             `degrees`        degrees per second, compared  radians per second
                                      with a bound in radians
phase unwrap         `unwrap`         applied to the yaw rate       none: a rate is no angle
yaw acceleration     `rate-twice`     the yaw rate once more        derivative of the yaw rate
time step of jerk    `half-jerk`      0.1 s, whatever the data      the true one
segments             `20-samples`     20 samples, whatever the rate 1 s
standing car         `standing`       comfortable                   left out (below 0.1 m/s all segment)
short episodes       `short-window`   filter window shrinks to the  no data below one filter window (7)
                                      data, no data below 3 samples
==================== ================ ============================= =====================================

A car that turns at 1 degree per second is thus uncomfortable in the official numbers, and one that never moves is
perfectly comfortable.
"""

from __future__ import annotations

import functools
from collections.abc import Collection
from dataclasses import dataclass
from math import fsum
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.episodes import require_mode, require_scorable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

FORWARD_MPS2 = (-4.05, 2.40)
LATERAL_MPS2 = (-4.89, 4.89)
JERK_MPS3 = (-8.37, 8.37)
FORWARD_JERK_MPS3 = (-4.13, 4.13)
YAW_ACCELERATION_RADPS2 = (-1.93, 1.93)
YAW_RATE_RADPS = (-0.95, 0.95)

COMFORT_QUIRKS = ("degrees", "unwrap", "rate-twice", "half-jerk", "20-samples", "standing", "short-window")
"""The quirks of the official tool in the table above; the mode `bench2drive` has all of them, `fixed` has none."""

_SEGMENT_SAMPLES = 20
_WINDOW_SAMPLES = 7
_POLYNOMIAL_ORDER = 2
_OFFICIAL_DT_S = 0.1
_STANDING_MPS = 0.1


@dataclass(frozen=True, slots=True)
class Motion:
    """The planar motion of a vehicle, one sample a tick: each array is (samples,) float64.

    `magnitude_mps2` is the length of the acceleration vector; it equals the length of (`forward`, `right`) unless the
    vehicle is tilted.
    """

    forward_mps2: Floats
    right_mps2: Floats
    magnitude_mps2: Floats
    yaw_rate_radps: Floats
    speed_mps: Floats
    dt_s: float


def comfort(result: EpisodeResult, *, mode: str = "bench2drive") -> float | None:
    """Return the share of comfortable segments of one episode in percent, 0..100, or None when it holds no data.

    Segments are 20 ticks long (1 s at 20 Hz; `fixed`: 1 s at any rate), an incomplete last one is dropped, an episode
    of at most one segment counts as one. A segment is comfortable when every signal is strictly within its bounds at
    every sample. Raises `UnknownNameError` for another mode and `ComparisonError` for an `infra_error`.
    """
    from pytest_drive_robust.arithmetic.arrays import hypot  # loads numpy

    require_mode(mode)
    require_scorable([result])
    forward, right, yaw_rate, speed = result.trace.columns("forward_mps2", "right_mps2", "yaw_rate_radps", "speed_mps")
    motion = Motion(
        forward_mps2=forward,
        right_mps2=right,
        magnitude_mps2=hypot(forward, right),
        yaw_rate_radps=yaw_rate,
        speed_mps=speed,
        dt_s=result.dt_s,
    )
    return comfort_of(motion, COMFORT_QUIRKS if mode == "bench2drive" else ())


def comfort_of(motion: Motion, quirks: Collection[str]) -> float | None:
    """Return `comfort` of a recorded motion with only the given `COMFORT_QUIRKS`, to show what each quirk changes."""
    count = len(motion.forward_mps2)
    if count < (_POLYNOMIAL_ORDER + 1 if "short-window" in quirks else _WINDOW_SAMPLES):
        return None
    samples = _SEGMENT_SAMPLES if "20-samples" in quirks else max(round(1.0 / motion.dt_s), _WINDOW_SAMPLES)
    samples = min(samples, count)
    parts = {name: _cut(getattr(motion, name), samples) for name in motion.__slots__ if name != "dt_s"}
    comfortable = _comfortable(parts, motion.dt_s, quirks)
    if "standing" not in quirks:
        comfortable = comfortable[(abs(parts["speed_mps"]) >= _STANDING_MPS).any(axis=-1)]
    return 100.0 * float(comfortable.sum()) / len(comfortable) if len(comfortable) else None


def _cut(values: Floats, samples: int) -> Floats:
    """Return the whole segments of (n,) `values` as (segments, samples); an incomplete last segment is dropped."""
    segments = len(values) // samples
    return values[: segments * samples].reshape(segments, samples)


def _comfortable(parts: dict[str, Floats], dt_s: float, quirks: Collection[str]) -> NDArray[np.bool_]:
    """Return for each segment whether all six signals are within their bounds at every sample."""
    import numpy as np

    step_s = _OFFICIAL_DT_S if "half-jerk" in quirks else dt_s
    forward, magnitude = _smooth(parts["forward_mps2"]), _smooth(parts["magnitude_mps2"])
    yaw_rate = parts["yaw_rate_radps"]
    if "degrees" in quirks:
        yaw_rate = np.degrees(yaw_rate)
    yaw_rate = _smooth(_unwrapped(yaw_rate) if "unwrap" in quirks else yaw_rate)
    signals = (
        (FORWARD_MPS2, forward),
        (LATERAL_MPS2, _smooth(parts["right_mps2"])),
        (JERK_MPS3, _slope(magnitude, step_s)),
        (FORWARD_JERK_MPS3, _slope(forward, step_s)),
        (YAW_ACCELERATION_RADPS2, yaw_rate if "rate-twice" in quirks else _slope(yaw_rate, dt_s)),
        (YAW_RATE_RADPS, yaw_rate),
    )
    low, high = np.array([bounds for bounds, _ in signals]).T[:, :, None, None]
    values = np.array([values for _, values in signals])
    within: NDArray[np.bool_] = ((low < values) & (values < high)).all(axis=(0, 2))
    return within


def _smooth(values: Floats) -> Floats:
    return parabola_filter(values, min(_WINDOW_SAMPLES, values.shape[-1]), derivative=0, step_s=1.0)


def _slope(values: Floats, step_s: float) -> Floats:
    return parabola_filter(values, min(_WINDOW_SAMPLES, values.shape[-1]), derivative=1, step_s=step_s)


def _unwrapped(rates: Floats) -> Floats:
    """Remove steps of more than pi between samples: meant for angles, but the official tool applies it to a rate."""
    import numpy as np

    turns = np.zeros_like(rates)
    turns[..., 1:] = np.cumsum(np.round(np.diff(rates, axis=-1) / (2.0 * np.pi)), axis=-1)
    corrected: Floats = rates - 2.0 * np.pi * turns
    return corrected


def parabola_filter(values: Floats, window: int, *, derivative: int, step_s: float) -> Floats:
    """Return `values` (..., samples) smoothed (`derivative` 0), or their slope per second (1), of the same shape.

    `window` is 3 or more and at most the number of samples; an even `window` must equal it. `step_s` is the time
    between two samples.
    """
    import numpy as np

    first, weights = _windows(values.shape[-1], window, derivative)
    filtered: Floats = weights[:, 0] * values[..., first]
    for k in range(1, window):
        filtered = filtered + weights[:, k] * values[..., first + k]
    return np.asarray(filtered / step_s) if derivative else filtered


@functools.lru_cache(maxsize=64)
def _windows(samples: int, window: int, derivative: int) -> tuple[NDArray[np.int64], Floats]:
    """Return the first index of each sample's window, (samples,), and the window's weights, (samples, window)."""
    import numpy as np

    within = np.arange(window) - (window - 1) / 2.0
    second = within * within
    squares, fourths = fsum(second), fsum(second * second)
    spread = window * fourths - squares * squares
    first = np.clip(np.arange(samples) - window // 2, 0, samples - window)
    at = within[np.arange(samples) - first][:, None]
    if derivative:
        return first, within / squares + 2.0 * at * (window * second - squares) / spread
    bent = fourths - squares * second + at * at * (window * second - squares)
    return first, bent / spread + at * within / squares
