"""Lanes that run side by side and lead the same way, as the roads of OpenDRIVE."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.domain.truth import Lane

_ALIGNED_M = 1.0
"""Lanes belong to one road when they begin and end beside each other to this accuracy."""


@dataclass(frozen=True, slots=True)
class Road:
    """`lanes` from left to right: the k-th is lane -(k + 1) of the road in OpenDRIVE."""

    id: int
    lanes: tuple[Lane, ...]

    @property
    def junction(self) -> bool:
        """Whether it lies in a junction."""
        return any(lane.junction for lane in self.lanes)


def roads_of(lanes: Sequence[Lane]) -> tuple[Road, ...]:
    """Return every lane in exactly one road, whose number is that of its leftmost lane."""
    by_index = {lane.index: lane for lane in lanes}
    found: list[Road] = []
    for lane in lanes:
        if _left_of(lane, by_index) is not None:
            continue
        beside = [lane]
        while (right := by_index.get(beside[-1].right)) is not None and _left_of(right, by_index) is beside[-1]:
            beside.append(right)
        found.append(Road(lane.index, tuple(beside)))
    return tuple(found)


def _left_of(lane: Lane, by_index: dict[int, Lane]) -> Lane | None:
    """Return the lane at its left, when both are of one road."""
    left = by_index.get(lane.left)
    if left is None or not lane.left_same_way or left.right != lane.index or lane.junction or left.junction:
        return None
    apart_m = (left.width_m + lane.width_m) / 2.0
    for row in (0, -1):
        x, y, yaw = np.asarray(left.centre[row], dtype=float)
        beside = np.array([x - np.sin(yaw) * apart_m, y + np.cos(yaw) * apart_m])
        if np.hypot(*(np.asarray(lane.centre[row, :2]) - beside)) > _ALIGNED_M:
            return None
    return left
