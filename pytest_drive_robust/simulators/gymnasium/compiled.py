"""An environment whose road is stepped by our compiled copy of highway-env's semantics: the same bits, sooner."""

from __future__ import annotations

from typing import Any

from pytest_drive_robust.simulators.compat import CompatRoad
from pytest_drive_robust.simulators.gymnasium.environments import RATE_HZ, Driven

__all__ = ["Compiled"]


class Compiled(Driven):
    """Mixed into an environment's class: only `Road.act` and `Road.step` are replaced, the rest is the environment's.

    Raises `SimulationError` in the first step on a road that the copy does not know (`compat.known`).
    """

    _copy: CompatRoad | None = None
    _copied: tuple[int, ...] = ()

    def reset(self, **given: Any) -> Any:
        """Forget the copy of the last episode's road."""
        self._copy = None
        return super().reset(**given)  # type: ignore[misc]

    def _simulate(self, action: Any = None) -> None:
        env: Any = self
        env.action_type.act(action)
        bodies = tuple(map(id, (*env.road.vehicles, *env.road.objects)))
        if self._copy is None:
            self._copy = CompatRoad.from_road(env.road, ego=env.vehicle)
        elif bodies != self._copied:  # the environment added or removed some
            self._copy.read_back()
        self._copied = bodies
        told = env.vehicle.action
        self._copy.step(1.0 / RATE_HZ, (float(told["acceleration"]), float(told["steering"])))
        self._copy.write_back()
        env.steps += 1
        if env.vehicle.speed < 0.0:  # rounding at rest: the ego has no reverse gear
            env.vehicle.speed = 0.0
            self._copy.read_back()
