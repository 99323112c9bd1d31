"""Find where the ego has to wait: lights, stop signs, junctions that other actors are about to cross."""

from __future__ import annotations

import math

from drive_robust_agents._planning.projection import crossed_junctions
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from pytest_drive_robust.domain.truth import LightState, WorldState
from pytest_drive_robust.jit.arrays import Floats, Ints

__all__ = ["RightOfWay"]

_STOP_SIGN, _COUNTS = int(LightState.STOP_SIGN), (int(LightState.RED), int(LightState.YELLOW))

_LOOK_M = 90.0
_HARD_BRAKE_MPS2 = 7.0
_LINE_GAP_M, _SIGN_GAP_M = 0.6, 0.4
_SOON_STEPS = 31
"""An actor that reaches the junction within so many forecast steps counts as crossing."""


class RightOfWay:
    """Remembers at which stop signs the ego came to rest, and stayed so for `halt_s`."""

    def __init__(self, halt_s: float = 0.0) -> None:
        self._halt_s = halt_s
        self._halted_s: dict[int, float] = {}
        self._stopped_at: set[int] = set()

    def stop_row(self, scene: StaticScene, world: WorldState, row: float, *, elapsed_s: float) -> float:
        """Return the row that the front bumper must not pass: a red light, or a stop sign without a stop yet.

        `elapsed_s` is the time since the last call.
        """
        nearest, v = math.inf, world.ego.speed_mps
        for index, at in scene.stops:
            if not -2.0 < at - row < _LOOK_M:
                continue
            light = int(world.lights[index])
            front = at - row - world.ego.length_m / 2.0
            if light == _STOP_SIGN and index not in self._stopped_at:
                halted = v < 0.09 and front < 3.0
                self._halted_s[index] = self._halted_s.get(index, 0.0) + elapsed_s if halted else 0.0
                if halted and self._halted_s[index] > self._halt_s:
                    self._stopped_at.add(index)
                else:
                    nearest = min(nearest, at - _SIGN_GAP_M)
            can_stop = front > -0.3 and v * v / (2.0 * _HARD_BRAKE_MPS2) < front + 0.5
            if light in _COUNTS and can_stop:
                nearest = min(nearest, at - _LINE_GAP_M)
        return nearest

    def keep_clear(self, scene: StaticScene, traffic: Traffic, path: Floats, leads: Ints) -> Floats:
        """Return (m, 2) first and last row of the junctions that others cross, in which the ego must not stop."""
        if len(scene.junctions) == 0:
            return scene.junctions
        crossed: Floats = scene.junctions[
            crossed_junctions(path, scene.junctions, traffic.forecast, leads, _SOON_STEPS) == 1
        ]
        return crossed
