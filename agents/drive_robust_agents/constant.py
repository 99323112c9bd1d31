"""`constant`: a little throttle, straight on. The lower end of every table."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.errors import UsageError

__all__ = ["Constant"]


class Constant:
    """Drives straight on with a fixed throttle, 0 to 1, without sensors. Raises `UsageError` for another throttle."""

    portable_bits = True
    consumes: frozenset[str] = frozenset()

    def __init__(self, throttle: float = 0.5) -> None:
        self.check(throttle)
        self.throttle = throttle

    @classmethod
    def check(cls, throttle: float = 0.5) -> None:
        """Raise `UsageError` for a throttle that no pedal has."""
        if not 0.0 <= throttle <= 1.0:
            raise UsageError(f"constant has the throttle {throttle!r}, expected 0 to 1, as in 'constant:throttle=0.5'.")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Do nothing, because the agent has no memory."""

    def act(self, observation: Observation) -> Control:
        """Return the same control in every tick."""
        return Control(throttle=self.throttle)
