"""Bursts of steering noise: the expert is pushed off its way and shows how it comes back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.vehicle import WHEELBASE_M, Mkz, Vehicle

__all__ = ["NOISY_SHARE", "burst_plan", "burst_steer"]

Floats = NDArray[np.float64]

NOISY_SHARE = 0.4
"""The share of episodes that have bursts."""
_MKZ = Mkz()
_WHEEL_RAD, _LATERAL_MPS2 = 0.12, 3.0
"""Of the bicycle's wheels; those of another vehicle turn by as much as makes it turn alike."""
_TICKS, _PAUSE_TICKS = (10, 20), (40, 160)


def burst_plan(rng: np.random.Generator, ticks: int) -> Floats:
    """Return the strength (-1..1) of the noise in each tick: bursts of 0.5 to 1 s, then 2 to 8 s of none.

    All zero in the episodes without noise.
    """
    added = np.zeros(ticks)
    if rng.random() >= NOISY_SHARE:
        return added
    at = int(rng.integers(20, _PAUSE_TICKS[1]))
    while at < ticks:
        last = at + int(rng.integers(_TICKS[0], _TICKS[1] + 1))
        added[at:last] = float(rng.uniform(-1.0, 1.0))
        at = last + int(rng.integers(*_PAUSE_TICKS))
    return added


def burst_steer(strength: float, speed_mps: float, *, vehicle: Vehicle = _MKZ) -> float:
    """Return what to add to the steering (-1..1) of a vehicle.

    Up to 0.12 rad of the bicycle's wheels or what turns another vehicle as much, and at speed up to 3 m/s2.
    """
    wheel = _WHEEL_RAD * (vehicle.wheelbase_m / WHEELBASE_M)
    most = min(wheel, _LATERAL_MPS2 * vehicle.wheelbase_m / max(speed_mps, 1.0) ** 2)
    return strength * most / vehicle.steer_max_rad
