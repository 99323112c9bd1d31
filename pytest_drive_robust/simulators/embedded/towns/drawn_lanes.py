"""highway-env's straight and circular lanes, computed with our own arithmetic.

Their classes take sine, arctangent and length from numpy, which rounds by processor and by version.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.simulators.embedded.towns import road_library

__all__ = ["CircularLane", "StraightLane"]

Floats = NDArray[np.float64]


class StraightLane(road_library.StraightLane):  # type: ignore[misc]
    """A straight line from `start` to `end`, (2,) each, in metres."""

    def __init__(self, start: Floats, end: Floats, **lane: object) -> None:
        super().__init__(start, end, **lane)
        dx, dy = float(end[0] - start[0]), float(end[1] - start[1])
        self.length = scalars.hypot(dx, dy)
        self.heading = scalars.atan2(dy, dx)
        self.direction = np.array([dx, dy]) / self.length
        self.direction_lateral = np.array([-self.direction[1], self.direction[0]])

    def sampled(self, at: Floats) -> Floats:
        """Return the points `at` (n,) metres along the lane: x, y, heading, (n, 3)."""
        points = self.start + at[:, None] * self.direction
        return np.column_stack([points, np.full(len(at), self.heading)])


class CircularLane(road_library.CircularLane):  # type: ignore[misc]
    """An arc around `center` (2,), as highway-env describes it; a phase is the direction from the centre in radians."""

    def position(self, longitudinal: float, lateral: float) -> Floats:
        """Return the point of these lane coordinates."""
        phase = self.direction * longitudinal / self.radius + self.start_phase
        reach = self.radius - lateral * self.direction
        return np.asarray(self.center + reach * np.array([scalars.cos(phase), scalars.sin(phase)]))

    def sampled(self, at: Floats) -> Floats:
        """Return the points `at` (n,) metres along the lane: x, y, heading, (n, 3)."""
        phase = self.direction * at / self.radius + self.start_phase
        x, y = self.center[0] + self.radius * arrays.cos(phase), self.center[1] + self.radius * arrays.sin(phase)
        return np.column_stack([x, y, phase + np.pi / 2.0 * self.direction])
