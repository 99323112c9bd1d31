"""The command that an agent gives to the vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class Control:
    """One command for one tick, in CARLA's conventions.

    ======== ======= =========================================
    field    range   meaning
    ======== ======= =========================================
    throttle 0..1    how far its pedal is pressed
    steer    -1..1   share of the largest steering angle, positive to the right
    brake    0..1    how far its pedal is pressed
    ======== ======= =========================================
    """

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0

    NEUTRAL: ClassVar[Control]

    def problem(self) -> str | None:
        """Return what is wrong with this control (`"steer is nan, expected a number in -1..1"`), or None."""
        throttle, steer, brake = self.throttle, self.steer, self.brake
        plain = type(throttle) is type(steer) is type(brake) is float
        if plain and 0.0 <= throttle <= 1.0 and -1.0 <= steer <= 1.0 and 0.0 <= brake <= 1.0:
            return None  # the fast way: called in every tick, and nearly every control is valid
        for name, value, low in (
            ("throttle", self.throttle, 0.0),
            ("steer", self.steer, -1.0),
            ("brake", self.brake, 0.0),
        ):
            number = _number(value)
            if number is None:
                return f"{name} is {value!r}, expected a number in {low:g}..1"
            if not math.isfinite(number) or not low <= number <= 1.0:
                return f"{name} is {number!r}, expected a number in {low:g}..1"
        return None


def _number(value: object) -> float | None:
    """Return a number of any library as a float; None for anything else, also for text that `float` would read."""
    if isinstance(value, (str, bytes, bytearray)):
        return None
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return None


Control.NEUTRAL = Control()
