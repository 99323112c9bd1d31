"""The vehicle that the agents here are made for: the embedded world's.

What a control does to its vehicle is what the maker of an agent knows; no agent asks the simulator.
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
