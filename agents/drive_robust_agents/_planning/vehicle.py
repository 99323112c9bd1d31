"""The vehicle that the agents here are made for: the embedded world's.

Whoever makes an agent knows what a control does to the vehicle; no agent asks the simulator.
"""

from __future__ import annotations

__all__ = ["ACCEL_MAX_MPS2", "BRAKE_MAX_MPS2", "POWER_WPKG", "STEER_MAX_RAD", "WHEELBASE_M"]

WHEELBASE_M = 2.85
STEER_MAX_RAD = 0.61
"""What a full `steer` turns the wheels by."""
ACCEL_MAX_MPS2 = 5.0
BRAKE_MAX_MPS2 = 8.0
POWER_WPKG = 55.0
"""Caps the acceleration at speed, W per kg."""
