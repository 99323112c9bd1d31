"""A highway-env lane along a line of points, for roads that are neither straight nor circular."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, project
from pytest_drive_robust.simulators.embedded.towns.road_library import AbstractLane

__all__ = ["TracedLane"]


class TracedLane(AbstractLane):  # type: ignore[misc]
    """`centre` is (n, 3): x, y in metres and heading in radians, points at equal steps of about a metre."""

    def __init__(
        self, centre: NDArray[np.float64], *, width: float, line_types: tuple[int, int], speed_limit: float
    ) -> None:
        self.centre = centre
        self.width = width
        self.line_types = list(line_types)
        self.speed_limit = speed_limit
        self.length = float(arc_lengths(centre)[-1])
        self.forbidden = False
        self.priority = 0

    def position(self, longitudinal: float, lateral: float) -> NDArray[np.float64]:
        """Return the point of these lane coordinates."""
        return np.array(place(self.centre, longitudinal, lateral)[:2])

    def local_coordinates(self, position: NDArray[np.float64]) -> tuple[float, float]:
        """Return (metres along the lane, metres to its right) of a point."""
        return project(self.centre, float(position[0]), float(position[1]))

    def heading_at(self, longitudinal: float) -> float:
        """Return the heading in radians so far along the lane."""
        return place(self.centre, longitudinal)[2]

    def width_at(self, longitudinal: float) -> float:
        """Return the width, the same everywhere, in metres."""
        return self.width

    @classmethod
    def from_config(cls, config: dict[str, object]) -> TracedLane:
        """Return highway-env's way to read a lane from a dictionary of these arguments."""
        return cls(**config)  # type: ignore[arg-type]

    def to_config(self) -> dict[str, object]:
        """Return what `from_config` reads."""
        return {
            "centre": self.centre,
            "width": self.width,
            "line_types": tuple(self.line_types),
            "speed_limit": self.speed_limit,
        }
