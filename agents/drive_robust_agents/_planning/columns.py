"""The columns of `Traffic.boxes`, one row for each actor: metres, radians, m/s, m/s2, cosine and sine of the yaw.

Some kernels take tables of the first six columns only.
"""

from __future__ import annotations

__all__ = ["ACCEL", "COLUMNS", "COS", "LENGTH", "SIN", "SPEED", "WIDTH", "YAW", "X", "Y"]

X, Y, YAW, SPEED, LENGTH, WIDTH, ACCEL, COS, SIN = range(9)
COLUMNS = 9
