"""The trace of an episode while it grows: one row for each tick."""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.result import Trace

if TYPE_CHECKING:
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.truth import EgoState

__all__ = ["Recorder"]


class Recorder:
    """Collects the rows of a `Trace`."""

    def __init__(self) -> None:
        self.ticks = 0
        self._rows = array("d")

    def add(self, ego: EgoState, control: Control, progress_m: float) -> None:
        """Add the state at the end of a tick and the control that led to it."""
        pose = (ego.x_m, ego.y_m, ego.yaw_rad)
        motion = (ego.speed_mps, ego.forward_mps2, ego.right_mps2, ego.yaw_rate_radps)
        self._rows.extend((*pose, *motion, control.throttle, control.steer, control.brake, progress_m))
        self.ticks += 1

    def trace(self) -> Trace:
        """Return what was recorded so far, in memory of its own."""
        import numpy as np

        width = len(Trace.COLUMNS)
        return Trace(np.array(self._rows[: self.ticks * width], dtype=np.float64).reshape(-1, width).copy())
