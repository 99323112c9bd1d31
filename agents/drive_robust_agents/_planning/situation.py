"""The situation of one tick, which all decisions of the expert share."""

from __future__ import annotations

from dataclasses import dataclass

from drive_robust_agents._planning.lateral import path_of
from drive_robust_agents._planning.right_of_way import RightOfWay
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from drive_robust_agents._vehicle.mkz import TICK_S
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Situation"]


@dataclass(frozen=True, slots=True)
class Situation:
    """The ego on its route, `ticks` after the last decisions, with the traffic around it.

    The ego is `right_m` metres to the right of the route at `row` and drifts `drift` metres to the right per metre of
    route. Its front bumper must not pass row `stop_row`. The ego leaves actors whose way it crosses `room_s` more than
    needed, until it has waited for long.
    """

    scene: StaticScene
    traffic: Traffic
    right_of_way: RightOfWay
    row: float
    right_m: float
    drift: float
    speed_mps: float
    stop_row: float
    ticks: int
    room_s: float

    @property
    def elapsed_s(self) -> float:
        """Seconds since the last decisions."""
        return TICK_S * self.ticks

    def path(self, profile: Floats) -> Floats:
        """Return the path from where the ego is onto a profile: see `lateral.path_of`."""
        return path_of(self.scene, profile, self.row, self.right_m, speed_mps=self.speed_mps, drift=self.drift)
