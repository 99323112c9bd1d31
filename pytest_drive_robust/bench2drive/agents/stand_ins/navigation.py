"""Stands in for `agents.navigation.local_planner` of CARLA's Python API: the navigation commands."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["RoadOption"]


class RoadOption(IntEnum):
    """CARLA's navigation commands, with its names and numbers."""

    VOID = -1
    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3
    LANEFOLLOW = 4
    CHANGELANELEFT = 5
    CHANGELANERIGHT = 6
