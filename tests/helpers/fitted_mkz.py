"""The fits of CARLA's Lincoln MKZ 2020 (0.9.15, 20 Hz), term by term as they were published.

PDM-Lite, SimLingo `Bench2Drive/leaderboard/team_code/config.py`, `kinematic_bicycle_model.py`; the steering is that of
World on Rails.
"""

from __future__ import annotations

import math

STEER_RAD, REAR_M, FRONT_M = 0.36848336, 1.4178275, -0.090769015
FITTED_THROTTLE = {
    (1, 0): 0.963873001,
    (2, 0): 4.37535692e-4,
    (0, 1): -0.380192912,
    (0, 2): 1.74950069,
    (1, 1): 0.0916787414,
    (1, 2): -0.0705461530,
    (2, 1): -1.05996152e-3,
    (2, 2): 6.71079346e-4,
}
"""The next speed in km/h: factors of powers of the speed in km/h and of the throttle."""
BRAKE = {
    (power + 1, 0): factor
    for power, factor in enumerate(
        (9.31711370e-3, 0.0820967431, -2.83832427e-3, 5.06587474e-5, -4.90357228e-7, 2.44419284e-9, -4.91381935e-12)
    )
}
"""The same for full brakes."""


def fitted_speed(speed_mps: float, throttle: float, fit: dict[tuple[int, int], float]) -> float:
    """Return the speed after a tick in m/s by one of the two fits."""
    kmh = 3.6 * speed_mps
    return sum(factor * kmh**i * throttle**j for (i, j), factor in fit.items()) / 3.6


def fitted_yaw_rate(speed_mps: float, steer: float) -> float:
    """Return radians per second."""
    slip = math.atan(REAR_M / (FRONT_M + REAR_M) * math.tan(steer * STEER_RAD))
    return speed_mps / REAR_M * math.sin(slip)
