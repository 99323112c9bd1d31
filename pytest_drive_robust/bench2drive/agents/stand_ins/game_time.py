"""Stands in for `srunner.scenariomanager.timer`: the clock of the simulated world."""

from __future__ import annotations

import datetime
from typing import ClassVar

__all__ = ["GameTime"]


class GameTime:
    """Seconds since the start of the route and the number of the frame. The adapter sets it before every step."""

    _current_game_time: ClassVar[float] = 0.0
    _last_frame: ClassVar[int] = 0

    @staticmethod
    def get_time() -> float:
        """Return simulated seconds since the start of the route."""
        return GameTime._current_game_time

    @staticmethod
    def get_carla_time() -> float:
        """Return the same as `get_time`: our worlds start with the route."""
        return GameTime._current_game_time

    @staticmethod
    def get_frame() -> int:
        """Return the number of the frame that `input_data` is of."""
        return GameTime._last_frame

    @staticmethod
    def get_wallclocktime() -> datetime.datetime:
        """Return the time of day on this computer."""
        return datetime.datetime.now()
