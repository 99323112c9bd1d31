"""Decide when to wait before a junction: for a red light, at a stop sign, for a gap in oncoming traffic."""

from __future__ import annotations

import math

from drive_robust_agents._classical.corridor import oncoming
from drive_robust_agents._classical.plan_path import Junction
from drive_robust_agents._classical.vision import signals
from pytest_drive_robust import RoadOption
from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["FRONT_M", "JunctionRules"]

FRONT_M = 2.45
"""From the middle of the vehicle to its front bumper."""

_BRAKE_MPS2 = 2.5
"""Deceleration of a stop by the rules."""
_LINE_TO_JUNCTION_M = 5.0
"""From the stop line to the place where the plan enters the junction."""
_BEFORE_LIGHT_M, _BEFORE_SIGN_M, _WAIT_BEFORE_M = 1.5, 1.2, 1.0
"""Where the vehicle stops: before the line at a red light and at a sign; before the entry to wait for a gap."""
_LOOK_FROM_M = 40.0
"""Lights and signs are looked at from this distance to the entry on."""
_RED_LASTS_S = 8.0
"""A light that was red and is hidden counts as red for this long."""
_LAMP_PX, _SIGN_PX, _SIGN_TICKS = 3, 8, 4
"""Least pixels of a lamp and of a sign, and the calls in which a sign must have been seen."""


class JunctionRules:
    """Remembers the lights and signs seen at the junction ahead, and the stops already made for signs."""

    def __init__(self) -> None:
        self._approach(None)

    def _approach(self, junction: Junction | None) -> None:
        self._junction = junction
        self._red_s, self._sign_ticks, self._standing_s, self._gap_ticks = 0.0, 0, 0.0, 0
        self._stopped, self._committed = False, False

    def speed(
        self, pixels: Pixels, bases: Floats, junction: Junction | None, at_m: float,
        speed_mps: float, elapsed_s: float,
    ) -> float:  # fmt: skip
        """Return the highest speed that the rules allow [m/s], infinity when no rule applies here.

        `bases` (k, 2) are the foreign points of `vision.GroundModel`, `at_m` the place along the path.
        `elapsed_s` is the time since the last call.
        """
        if junction is not self._junction:
            self._approach(junction)
        if junction is None:
            return math.inf
        to_entry_m = junction.entry_m - at_m
        turn = self._left_turn(bases, to_entry_m) if junction.command is RoadOption.LEFT else math.inf
        return min(turn, self._signals(pixels, to_entry_m, speed_mps, elapsed_s))

    def _left_turn(self, bases: Floats, to_entry_m: float) -> float:
        """Return the speed that waits before the middle of the junction for a gap; drive through once the gap came."""
        to_wait_m = to_entry_m - _WAIT_BEFORE_M
        if self._committed or not -2.5 < to_wait_m < 12.0:
            return math.inf
        self._gap_ticks = 0 if oncoming(bases) else self._gap_ticks + 1
        self._committed = self._gap_ticks >= 2 and to_wait_m < 2.5
        return math.inf if self._gap_ticks >= 2 else _stopping(to_wait_m)

    def _signals(self, pixels: Pixels, to_entry_m: float, speed_mps: float, elapsed_s: float) -> float:
        """Return the speed that stops before the line while the light is red, and once for a stop sign."""
        if not 0.0 <= to_entry_m < _LOOK_FROM_M:
            return math.inf
        seen = signals(pixels)
        to_line_m = to_entry_m - FRONT_M - _LINE_TO_JUNCTION_M
        if seen.green >= _LAMP_PX:
            self._red_s = 0.0
        elif seen.red >= _LAMP_PX:
            self._red_s = _RED_LASTS_S
        else:  # a hidden light counts as red until it is seen green
            self._red_s = max(0.0, self._red_s - elapsed_s)
        self._sign_ticks += seen.sign >= _SIGN_PX and seen.sign > 3 * seen.red
        if self._red_s > 0.0 and to_line_m > -0.5:
            return _stopping(to_line_m - _BEFORE_LIGHT_M)
        if self._sign_ticks >= _SIGN_TICKS and not self._stopped:
            self._standing_s = self._standing_s + elapsed_s if abs(speed_mps) < 0.05 else 0.0
            self._stopped = self._standing_s > 0.4 and to_line_m < 3.5
            return _stopping(to_line_m - _BEFORE_SIGN_M)
        return math.inf


def _stopping(distance_m: float) -> float:
    """Return the speed from which a comfortable stop in this distance is possible [m/s]."""
    return math.sqrt(2.0 * _BRAKE_MPS2 * distance_m) if distance_m > 0.1 else 0.0
