"""What sets an actor off once its scenario has started."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Arrival", "Passing", "Trigger"]


@dataclass(frozen=True, slots=True)
class Arrival:
    """The ego is nearer than `within_m` to the actor's conflict point, or less than `tta_s` away at its speed."""

    tta_s: float
    within_m: float


@dataclass(frozen=True, slots=True)
class Passing:
    """The ego has passed `progress_m` metres of the route."""

    progress_m: float


Trigger = Arrival | Passing
