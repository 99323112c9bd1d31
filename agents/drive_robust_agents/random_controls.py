"""`random`: seeded random controls. Shows that scores do not come for free, and exercises the simulator."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers

__all__ = ["RandomControls"]


class RandomControls:
    """Draws a new random control every half second; equal seeds give equal controls."""

    portable_bits = True
    consumes: frozenset[str] = frozenset()
    hold_ticks = 10

    def __init__(self) -> None:
        self._numbers = RandomNumbers((0, 0))
        self._control, self._due = Control(), 0

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Start the sequence of this seed."""
        self._numbers = RandomNumbers((seed % 2**64, 0))
        self._control, self._due = Control(), 0

    def act(self, observation: Observation) -> Control:
        """Draw throttle 0..1 and steer -0.3..0.3, and a brake one time in five."""
        if observation.tick >= self._due:
            self._due = (observation.tick // self.hold_ticks + 1) * self.hold_ticks
            throttle, steer, brake = (self._numbers.random() for _ in range(3))
            braking = brake < 0.2
            self._control = Control(
                throttle=0.0 if braking else throttle,
                steer=0.6 * steer - 0.3,
                brake=5.0 * brake if braking else 0.0,
            )
        return self._control
