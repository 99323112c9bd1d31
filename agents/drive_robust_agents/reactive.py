"""`reactive`: follows its lane and brakes for bodies ahead in it, nothing else. A benchmark must be harder than this.

`reactive` sees the ground truth, but reads no lights and no signs, yields to nobody and overtakes nothing. Routes that
it passes need no planning. A benchmark on which it scores well measures lane keeping only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drive_robust_agents._planning.control import pedals, speed_profile, steer_along
from drive_robust_agents._planning.projection import nearest_ahead
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, WorldState
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Reactive"]

_LATERAL_MPS2, _BRAKE_MPS2 = 2.8, 2.0
# IDM (Treiber, Hennecke, Helbing 2000)
_GAP_M, _HEADWAY_S, _ACCEL_MPS2, _COMFORT_MPS2, _HARDEST_MPS2 = 2.0, 1.2, 2.5, 2.5, 8.0
_CORRIDOR_MARGIN_M = 0.2


class Reactive:
    """Drives by the intelligent driver model on the nearest body in the ego's corridor along the route."""

    privileged = True
    portable_bits = True
    consumes: frozenset[str] = frozenset()

    def __init__(self) -> None:
        self._limits: Floats | None = None

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras, because the agent sees the ground truth."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode."""
        self._limits = None

    def act(self, observation: Observation) -> Control:
        """Return the control that follows the route. Raises `ValueError` without ground truth.

        The episode loop gives ground truth to privileged agents.
        """
        truth = observation.truth
        if truth is None:
            raise ValueError("reactive needs Observation.truth: it is a privileged agent")
        if self._limits is None:
            self._limits = speed_profile(truth.route, lateral_mps2=_LATERAL_MPS2, brake_mps2=_BRAKE_MPS2)
        ego = truth.state.ego
        wanted = self._limits[min(truth.progress + int(0.3 * ego.speed_mps) + 1, len(self._limits) - 1)]
        gap, speed = _leader(truth)
        return pedals(
            ego, _idm(ego.speed_mps, float(wanted), gap, speed), steer_along(ego, truth.route, truth.progress)
        )


def _leader(truth: GroundTruth) -> tuple[float, float]:
    """Return (bumper-to-bumper metres, speed along the route) of the nearest body in the corridor, or (inf, 0)."""
    world, ego = truth.state, truth.state.ego
    rows = world.actors[world.actors[:, WorldState.KIND] != ActorKind.DIRT]
    boxes = np.ascontiguousarray(
        rows[:, [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.SPEED, WorldState.LENGTH, WorldState.WIDTH]]
    )
    pose = (ego.x_m, ego.y_m, ego.length_m, ego.width_m + 2.0 * _CORRIDOR_MARGIN_M)
    return nearest_ahead(truth.route, truth.progress, pose, boxes)


def _idm(v: float, wanted: float, gap: float, leader: float) -> float:
    """Return the acceleration of the intelligent driver model [m/s2]."""
    free = _ACCEL_MPS2 * (1.0 - _squared(_squared(v / max(wanted, 0.1))))
    if math.isfinite(gap):
        closing = v * (v - leader) / (2.0 * math.sqrt(_ACCEL_MPS2 * _COMFORT_MPS2))
        desired = _GAP_M + max(0.0, v * _HEADWAY_S + closing)
        free = min(free, _ACCEL_MPS2 * (1.0 - _squared(desired / max(gap, 0.1))))
    return max(free, -_HARDEST_MPS2)


def _squared(x: float) -> float:
    return x * x
