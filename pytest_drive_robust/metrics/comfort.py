"""Comfort ("comfortness", smoothness): the share of seconds in which six motion signals stay within bounds.

Source: Bench2Drive `tools/efficiency_smoothness_benchmark.py`; the bounds are nuPlan's. Two modes:

==================== ============================= =====================================
point                bench2drive (bug-compatible)  fixed
==================== ============================= =====================================
yaw rate             degrees per second, compared  radians per second
                     with a bound in radians
phase unwrap         applied to the yaw rate       none: a rate is no angle
yaw acceleration     the yaw rate once more        derivative of the yaw rate
time step of jerk    0.1 s, whatever the data      the true one
standing car         comfortable                   left out (below 0.1 m/s all segment)
short episodes       filter window shrinks to the  no data below one filter window (7)
                     data, no data below 3 samples
==================== ============================= =====================================

A car that turns at 1 degree per second is thus uncomfortable in the official numbers, and one that never moves is
perfectly comfortable.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.guards import require_mode, require_scorable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["comfort"]

FORWARD_MPS2 = (-4.05, 2.40)
LATERAL_MPS2 = (-4.89, 4.89)
JERK_MPS3 = (-8.37, 8.37)
FORWARD_JERK_MPS3 = (-4.13, 4.13)
YAW_ACCELERATION_RADPS2 = (-1.93, 1.93)
YAW_RATE_RADPS = (-0.95, 0.95)

_SEGMENT_SAMPLES = 20
_WINDOW_SAMPLES = 7
_POLYNOMIAL_ORDER = 2
_OFFICIAL_DT_S = 0.1
_STANDING_MPS = 0.1


def comfort(result: EpisodeResult, *, mode: str = "bench2drive") -> float | None:
    """The share of comfortable segments of one episode in percent, 0..100, or None when it holds no data.

    Segments are 20 ticks long (1 s at 20 Hz; `fixed`: 1 s at any rate), an incomplete last one is dropped, an episode
    of at most one segment counts as one. A segment is comfortable when every signal is strictly within its bounds at
    every sample. Raises `UnknownNameError` for another mode and `ComparisonError` for an `infra_error`.
    """
    require_mode(mode)
    require_scorable([result])
    rows = result.trace.rows
    fixed = mode == "fixed"
    if len(rows) < (_WINDOW_SAMPLES if fixed else _POLYNOMIAL_ORDER + 1):
        return None
    samples = max(round(1.0 / result.dt_s), _WINDOW_SAMPLES) if fixed else _SEGMENT_SAMPLES
    verdicts = []
    for first in range(0, max(len(rows) - samples, 0) + 1, samples):
        part = slice(first, first + samples)
        if fixed and bool((abs(result.trace.column("speed_mps")[part]) < _STANDING_MPS).all()):
            continue
        verdicts.append(_is_comfortable(_signals(result, part, fixed=fixed)))
    return 100.0 * sum(verdicts) / len(verdicts) if verdicts else None


def _signals(result: EpisodeResult, part: slice, *, fixed: bool) -> list[tuple[tuple[float, float], Floats]]:
    """The six signals of a segment, each with its bounds."""
    import numpy as np

    forward = _smooth(result.trace.column("forward_mps2")[part])
    right = result.trace.column("right_mps2")[part]
    magnitude = _smooth(np.hypot(result.trace.column("forward_mps2")[part], right))
    raw_yaw_rate = result.trace.column("yaw_rate_radps")[part]
    step_s = result.dt_s if fixed else _OFFICIAL_DT_S
    if fixed:
        yaw_rate = _smooth(raw_yaw_rate)
        yaw_acceleration = _slope(yaw_rate, result.dt_s)
    else:
        yaw_rate = yaw_acceleration = _smooth(_unwrapped(np.degrees(raw_yaw_rate)))
    return [
        (FORWARD_MPS2, forward),
        (LATERAL_MPS2, _smooth(right)),
        (JERK_MPS3, _slope(magnitude, step_s)),
        (FORWARD_JERK_MPS3, _slope(forward, step_s)),
        (YAW_ACCELERATION_RADPS2, yaw_acceleration),
        (YAW_RATE_RADPS, yaw_rate),
    ]


def _is_comfortable(signals: list[tuple[tuple[float, float], Floats]]) -> bool:
    return all(bool(((low < values) & (values < high)).all()) for (low, high), values in signals)


def _smooth(values: Floats) -> Floats:
    return _savitzky_golay(values, derivative=0, step_s=1.0)


def _slope(values: Floats, step_s: float) -> Floats:
    return _savitzky_golay(values, derivative=1, step_s=step_s)


def _savitzky_golay(values: Floats, *, derivative: int, step_s: float) -> Floats:
    from scipy.signal import savgol_filter

    window = min(_WINDOW_SAMPLES, len(values))
    filtered: Floats = savgol_filter(values, window, _POLYNOMIAL_ORDER, deriv=derivative, delta=step_s)
    return filtered


def _unwrapped(rates: Floats) -> Floats:
    """Steps of more than half of 2 pi between samples taken out: meant for angles, applied to a rate by the tool."""
    import numpy as np

    turns = np.concatenate(([0.0], np.cumsum(np.round(np.diff(rates) / (2.0 * np.pi)))))
    corrected: Floats = rates - 2.0 * np.pi * turns
    return corrected
