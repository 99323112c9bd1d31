"""How fast: the strongest acceleration that stays out of trouble, and whether a manoeuvre can be driven at all."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drive_robust_agents._planning.control import Floats
from drive_robust_agents._planning.forecast import leaders, rollouts
from drive_robust_agents._planning.junctions import Junctions
from drive_robust_agents._planning.scene import Scene
from drive_robust_agents._planning.traffic import Traffic

__all__ = ["Moment", "SpeedChoice", "is_free"]

_ACCELERATIONS = np.array([4.5, 2.3, 1.2, 0.6, 0.0, -0.8, -1.6, -2.6, -4.0, -6.0, -8.0])
_COMFORT_ACCEL_MPS2 = 2.3
_COMFORT_BRAKE_MPS2 = -3.2
_REACT_S = 0.4
_HORIZON_STEPS = 30
_DT_S = 0.05
_GAP_MPS = 7.0
"""Below this speed a quick start is worth it when only that uses a gap."""
_PATIENCE_S = 5.0
_MARGINS, _TIGHT_MARGINS = np.array([1.2, 0.7, 0.25]), np.array([0.5, 0.3, 0.1])
_PASS_ACCELERATIONS = np.array([4.0, 2.3, 1.2, 0.0, -1.2])
_LEFT_ALONE_S = 0.5


@dataclass(frozen=True, slots=True)
class Moment:
    """What the decisions of one tick share; `right_m` is where the ego is, beside the route at `row`."""

    scene: Scene
    traffic: Traffic
    junctions: Junctions
    row: float
    right_m: float
    speed_mps: float
    stop_row: float


def is_free(now: Moment, path: Floats, until_row: float) -> bool:
    """Can a path be driven up to a row, or at least as far as the forecast reaches, without stopping on it?"""
    plans = np.column_stack([_PASS_ACCELERATIONS, np.full(len(_PASS_ACCELERATIONS), np.inf), _PASS_ACCELERATIONS])
    plans = plans if now.speed_mps > 4.0 else plans[:2]
    traffic, scene = now.traffic, now.scene
    leads = leaders(path, now.row, traffic.boxes)
    found, driven = rollouts(
        path, now.row, now.speed_mps, scene.size, traffic.forecast, traffic.sizes, leads, plans, scene.limits,
        np.zeros((0, 2)), now.stop_row, _MARGINS, False,
    )  # fmt: skip
    whole = (traffic.forecast.shape[1] - 1) * 0.2
    return bool(np.any((found >= whole - 1e-9) | (now.row + driven >= until_row)))


class SpeedChoice:
    """Remembers for how long the ego has been waiting."""

    def __init__(self) -> None:
        self._waited_s = 0.0
        self._pushing = False

    def choose(self, now: Moment, path: Floats, stop_row: float, *, cruise_mps: float) -> float:
        """Acceleration in m/s2; when nothing stays out of trouble, the one that does so longest."""
        v, scene = now.speed_mps, now.scene
        self._waited_s = self._waited_s + _DT_S if v < 0.5 else 0.0
        self._pushing = self._waited_s > _PATIENCE_S or (self._pushing and v < _GAP_MPS)
        limit = min(scene.limits[int(np.clip(now.row + 0.3 * v, 0, scene.count - 1))], max(cruise_mps, 3.0))
        wanted = float(np.clip(1.2 * (limit - v), -2.5, _COMFORT_ACCEL_MPS2))
        trial = _Trial(now, path, stop_row, pushy=self._pushing)
        if trial.survives(wanted):
            return wanted
        for margins in (_MARGINS, _TIGHT_MARGINS):
            free = trial.seconds(_ACCELERATIONS, margins)
            if free.max() >= trial.horizon_s - 1e-9:
                break
        safe = _ACCELERATIONS[free >= trial.horizon_s - 1e-9]
        if len(safe) == 0:
            return float(_ACCELERATIONS[int(np.argmax(free))]) if free.max() > _LEFT_ALONE_S else -8.0
        gentle = safe[safe <= _COMFORT_ACCEL_MPS2]
        if v < _GAP_MPS and safe[0] > _COMFORT_ACCEL_MPS2 and (len(gentle) == 0 or gentle[0] < 0.5):
            return float(safe[0])  # a gap that only a quick start can use
        return float(min(gentle[0], wanted)) if len(gentle) else float(safe[0])


class _Trial:
    """Plans on one path in one moment."""

    def __init__(self, now: Moment, path: Floats, stop_row: float, *, pushy: bool) -> None:
        traffic = now.traffic
        self.now, self.path, self.stop_row, self.pushy = now, path, stop_row, pushy
        self.leads = leaders(path, now.row, traffic.boxes)
        self.boxes = now.junctions.keep_clear(now.scene, traffic, path, self.leads)
        self.forecast = np.ascontiguousarray(traffic.forecast[:, : _HORIZON_STEPS + 1])
        self.horizon_s = 0.2 * _HORIZON_STEPS

    def survives(self, acceleration: float) -> bool:
        """Does going on for a moment leave the way to stop?"""
        plan = np.array([[acceleration, _REACT_S, min(acceleration, _COMFORT_BRAKE_MPS2)]])
        return bool(self._roll(plan, _MARGINS)[0] >= self.horizon_s - 1e-9)

    def seconds(self, accelerations: Floats, margins: Floats) -> Floats:
        """Seconds until trouble for each: either going through is safe to the end, or a moment later stopping is."""
        count = len(accelerations)
        through = np.column_stack([accelerations, np.full(count, np.inf), accelerations])
        then_stop = np.column_stack(
            [accelerations, np.full(count, _REACT_S), np.minimum(accelerations, _COMFORT_BRAKE_MPS2)]
        )
        free = self._roll(np.concatenate([through, then_stop]), margins)
        best: Floats = np.maximum(free[:count], free[count:])
        return best

    def _roll(self, plans: Floats, margins: Floats) -> Floats:
        now, scene = self.now, self.now.scene
        found, _ = rollouts(
            self.path, now.row, now.speed_mps, scene.size, self.forecast, now.traffic.sizes, self.leads, plans,
            scene.limits, self.boxes, self.stop_row, margins, self.pushy,
        )  # fmt: skip
        return np.asarray(found)
