"""The trace of an episode while it grows: one preallocated row for each tick."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.domain.result import Trace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.truth import EgoState

__all__ = ["Recorder"]

_FIRST_CAPACITY = 512  # 26 s at 20 Hz


class Recorder:
    """Collects the rows of a `Trace`; its memory doubles when it is full."""

    def __init__(self) -> None:
        import numpy as np

        self.ticks = 0
        self._rows: NDArray[np.float64] = np.empty((_FIRST_CAPACITY, len(Trace.COLUMNS)))

    def add(self, ego: EgoState, control: Control, progress_m: float) -> None:
        """Add the state at the end of a tick and the control that led to it."""
        if self.ticks == len(self._rows):
            self._grow()
        self._rows[self.ticks] = (
            ego.x_m,
            ego.y_m,
            ego.yaw_rad,
            ego.speed_mps,
            ego.forward_mps2,
            ego.right_mps2,
            ego.yaw_rate_radps,
            control.throttle,
            control.steer,
            control.brake,
            progress_m,
        )
        self.ticks += 1

    def trace(self) -> Trace:
        """Return what was recorded so far, in memory of its own."""
        return Trace(self._rows[: self.ticks].copy())

    def _grow(self) -> None:
        import numpy as np

        self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
