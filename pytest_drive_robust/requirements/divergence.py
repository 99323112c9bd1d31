"""When a perturbed episode began to differ from its clean twin."""

from __future__ import annotations

from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["first_divergence_s"]

_DISTANCE_M = 0.5
_SPEED_MPS = 1.0


def first_divergence_s(clean: EpisodeResult, perturbed: EpisodeResult) -> float | None:
    """Seconds from the start until the two egos differ for the first time, or None when they never do.

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
    apart = (abs(ahead) > _DISTANCE_M) | (abs(beside) > _DISTANCE_M) | (abs(faster) > _SPEED_MPS)
    if not bool(apart.any()):
        return None
    return float((int(np.argmax(apart)) + 1) * clean.dt_s)  # a row of the trace is the end of its tick
