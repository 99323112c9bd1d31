"""Bursts of steering noise, which push the expert off its way, so that it shows how to come back."""

from __future__ import annotations

import numpy as np

from drive_robust_agents._vehicle import mkz, plain_car
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["NOISY_SHARE", "burst_plan", "burst_steer"]

NOISY_SHARE = 0.4
"""Share of episodes with bursts."""
_WHEEL_RAD = 0.12 * (mkz.WHEELBASE_M / plain_car.WHEELBASE_M)
"""Wheel angle that turns the car as much as 0.12 rad turn a plain car."""
_LATERAL_MPS2 = 3.0
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


def burst_steer(strength: float, speed_mps: float) -> float:
    """Return the noise to add to the steering (-1..1): `strength` * 0.12 rad of a plain car, at speed up to 3 m/s2."""
    most = min(_WHEEL_RAD, _LATERAL_MPS2 * mkz.WHEELBASE_M / max(speed_mps, 1.0) ** 2)
    return strength * most / mkz.STEER_MAX_RAD
