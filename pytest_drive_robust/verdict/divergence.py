"""When a perturbed episode began to differ from its clean twin."""

from __future__ import annotations

from typing import NamedTuple

from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["Divergence", "first_divergence", "first_divergence_s"]

_DISTANCE_M = 0.5
_SPEED_MPS = 1.0


class Divergence(NamedTuple):
    """Seconds from the start, and what left its tolerance first: `"in speed"`, `"in distance"`
    along the way, or `"sideways"`."""

    second: float
    signal: str


def first_divergence_s(clean: EpisodeResult, perturbed: EpisodeResult) -> float | None:
    """The second of `first_divergence`."""
    found = first_divergence(clean, perturbed)
    return None if found is None else found.second


def first_divergence(clean: EpisodeResult, perturbed: EpisodeResult) -> Divergence | None:
    """When the two egos differ for the first time and in what, or None when they never do.

    They differ when, at the same tick, one is more than 0.5 m ahead, behind or beside the other (in the frame of the
    clean ego) or more than 1 m/s faster or slower. Only the ticks that both episodes have are compared.
    """
    import numpy as np

    ticks = min(len(clean.trace.rows), len(perturbed.trace.rows))
    yaw, x_m, y_m, speed_mps = (clean.trace.column(name)[:ticks] for name in ("yaw_rad", "x_m", "y_m", "speed_mps"))
    east = perturbed.trace.column("x_m")[:ticks] - x_m
    south = perturbed.trace.column("y_m")[:ticks] - y_m
    ahead = np.cos(yaw) * east + np.sin(yaw) * south
    beside = np.cos(yaw) * south - np.sin(yaw) * east
    faster = perturbed.trace.column("speed_mps")[:ticks] - speed_mps
    signals = {
        "sideways": abs(beside) / _DISTANCE_M,
        "in speed": abs(faster) / _SPEED_MPS,
        "in distance": abs(ahead) / _DISTANCE_M,
    }
    apart = np.array(list(signals.values())) > 1.0
    if not bool(apart.any()):
        return None
    row = int(np.argmax(apart.any(axis=0)))
    first = max(signals, key=lambda name: float(signals[name][row]))
    return Divergence(float((row + 1) * clean.dt_s), first)  # a row of the trace is the end of its tick
