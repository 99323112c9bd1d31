"""Roads of a town along given lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.geometry import resample
from pytest_drive_robust.simulators.embedded.towns.pieces import draw_strips
from pytest_drive_robust.simulators.embedded.towns.road_library import AbstractLane
from pytest_drive_robust.simulators.embedded.towns.town import Section, Town
from pytest_drive_robust.simulators.embedded.towns.traced_lane import TracedLane
from pytest_drive_robust.simulators.embedded.traced.lines import reversed_line, shifted

__all__ = ["trace_road"]

Floats = NDArray[np.float64]


def trace_road(town: Town, name: str, line: Floats, section: Section, *, first: int = 0) -> None:
    """Draw a road whose divider (of a one-way road: left edge) is `line`; chains are named as by `pieces.road`.

    Raises `RouteError` where the line bends so tightly that a lane beside it would turn back on itself.
    """

    def curve(offset: float, *, backward: bool, **lane: object) -> AbstractLane:
        beside = shifted(line, offset)
        along = arrays.cos(line[:-1, 2]) * np.diff(beside[:, 0]) + arrays.sin(line[:-1, 2]) * np.diff(beside[:, 1])
        if (along <= 0.0).any():
            raise RouteError(f"its road bends so tightly that no lane fits {abs(offset):.1f} m beside its middle")
        if backward:
            beside = reversed_line(beside)
        centre = resample(beside)
        centre[0, 2], centre[-1, 2] = beside[0, 2], beside[-1, 2]
        return TracedLane(centre, **lane)  # type: ignore[arg-type]

    draw_strips(town, name, first, curve, section)
