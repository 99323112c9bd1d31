"""Driving efficiency: the ego's speed in percent of the speed of the traffic around it.

Source: Bench2Drive, criterion `MinimumSpeedRouteTest` (one value per twentieth of the route, in the record) and
`tools/efficiency_smoothness_benchmark.py` (the averages below).
"""

from __future__ import annotations

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.episodes import require_mode, require_scorable

LARGEST_RATIO_PCT = 1000.0
"""The official tool drops larger values: they come from traffic that stands."""


def efficiency(result: EpisodeResult, *, mode: str = "bench2drive") -> float | None:
    """Return the efficiency of one episode in percent, 0 or more; values above 100 are normal.

    ============ ========================================= ======================================
    mode         values above 1000 %                       an ego that never reached a checkpoint
    ============ ========================================= ======================================
    bench2drive  dropped; None when none is left           None: the route is left out
    fixed        kept: the ego was that fast beside them   0: being stuck is not efficient
    ============ ========================================= ======================================

    The official tool divides by zero where this returns None. Raises `UnknownNameError` for another mode and
    `ComparisonError` for an `infra_error`.
    """
    require_mode(mode)
    require_scorable([result])
    if mode == "fixed":
        return mean(result.speed_ratios_pct) if result.speed_ratios_pct else 0.0
    kept = [ratio for ratio in result.speed_ratios_pct if ratio <= LARGEST_RATIO_PCT]
    return mean(kept) if kept else None
