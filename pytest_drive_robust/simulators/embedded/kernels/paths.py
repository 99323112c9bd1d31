"""Places along the lines that actors follow."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic.compiled import cos_sin
from pytest_drive_robust.jit.kernels import inner

__all__ = ["path_pose"]


@inner
def path_pose(
    paths: NDArray[np.float64], first: int, last: int, step_m: float, s: float, right_m: float
) -> tuple[float, float, float]:
    """Return x, y, yaw of a point `s` metres along the path of rows `first` to `last` and `right_m` beside it."""
    share = s / step_m
    index = int(min(max(math.floor(share), 0.0), last - first - 2.0))
    share -= index
    k = first + index
    x = paths[k, 0] + share * (paths[k + 1, 0] - paths[k, 0])
    y = paths[k, 1] + share * (paths[k + 1, 1] - paths[k, 1])
    bounded = min(max(share, 0.0), 1.0)
    yaw = paths[k, 2] + bounded * (paths[k + 1, 2] - paths[k, 2])
    along, beside = cos_sin(yaw)
    return x - right_m * beside, y + right_m * along, yaw
