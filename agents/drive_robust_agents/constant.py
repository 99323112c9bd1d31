"""`constant`: a little throttle, straight on. The lower end of every table."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation

__all__ = ["Constant"]


class Constant:
    """Drives straight on with a fixed throttle and looks at nothing."""

    portable_bits = True
    consumes: frozenset[str] = frozenset()

    def __init__(self, throttle: float = 0.5) -> None:
        self.throttle = throttle

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Do nothing: there is nothing to forget."""

    def act(self, observation: Observation) -> Control:
        """Return the same control in every tick."""
        return Control(throttle=self.throttle)
