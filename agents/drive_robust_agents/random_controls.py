"""`random`: seeded random controls. Shows that scores do not come for free, and exercises the simulator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation

__all__ = ["RandomControls"]


class RandomControls:
    """A new random control every half second, the same ones for the same seed."""

    consumes: frozenset[str] = frozenset()
    hold_ticks = 10

    def __init__(self) -> None:
        self._generator = np.random.default_rng(0)
        self._control = Control()

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Start the sequence of this seed."""
        self._generator = np.random.default_rng(seed)

    def act(self, observation: Observation) -> Control:
        """Draw throttle 0..1 and steer -0.3..0.3, and a brake one time in five."""
        if observation.tick % self.hold_ticks == 0:
            throttle, steer, brake = self._generator.random(3)
            braking = brake < 0.2
            self._control = Control(
                throttle=0.0 if braking else float(throttle),
                steer=float(0.6 * steer - 0.3),
                brake=float(brake * 5.0) if braking else 0.0,
            )
        return self._control
