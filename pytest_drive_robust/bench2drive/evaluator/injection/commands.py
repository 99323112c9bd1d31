"""Copies of commands to CARLA's vehicle, and the neutral command."""

from __future__ import annotations

import copy
import importlib
from typing import Any

__all__ = ["copied", "neutral_like"]

_FIELDS = ("throttle", "steer", "brake", "hand_brake", "reverse", "manual_gear_shift", "gear")


def copied(control: Any) -> Any:
    """Return a copy of a command: agents and scenarios change their commands in place."""
    try:
        made = type(control)()
    except TypeError:
        return copy.copy(control)
    for name in _FIELDS:
        if hasattr(control, name):
            setattr(made, name, getattr(control, name))
    return made


def neutral_like(control: Any) -> Any:
    """Return a command without throttle, steering and brake, of the class of `control`, or of CARLA's for None."""
    made = importlib.import_module("carla").VehicleControl() if control is None else copied(control)
    made.throttle = made.steer = made.brake = 0.0
    made.hand_brake = made.reverse = False
    return made
