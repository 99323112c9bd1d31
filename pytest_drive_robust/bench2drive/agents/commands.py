"""What `run_step` returns as our `Control`: a `carla.VehicleControl`, or anything with its fields."""

from __future__ import annotations

import math

from pytest_drive_robust.domain.control import Control

__all__ = ["control_of"]

_FIELDS = (("throttle", 0.0), ("steer", -1.0), ("brake", 0.0))


def control_of(command: object) -> Control:
    """Return the same command, held within its ranges as CARLA does. Raises `TypeError` and `ValueError`.

    The hand brake brakes with all that there is. Our vehicle has no reverse gear: to ask for it is an error, not a
    drive forward. Numbers that are none (NaN) stay what they are, for the loop to blame.
    """
    values: list[float] = []
    for field, low in _FIELDS:
        given = getattr(command, field, None)
        try:
            number = float(given)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise TypeError(
                f"run_step returned {command!r} of type {type(command).__name__} whose {field} is {given!r}, expected "
                "a carla.VehicleControl or an object with its fields"
            ) from None
        values.append(number if math.isnan(number) else min(max(number, low), 1.0))
    throttle, steer, brake = values
    if getattr(command, "reverse", False):
        raise ValueError(f"run_step returned {command!r}, which asks for the reverse gear: the vehicle here has none")
    if getattr(command, "hand_brake", False):
        throttle, brake = 0.0, 1.0
    return Control(throttle, steer, brake)
