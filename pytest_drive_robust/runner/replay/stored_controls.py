"""An agent that gives the controls of a stored episode again.

What drove may depend on the processor; the world does not. So the trajectory comes back to the last bit on any machine,
with or without whoever drove.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.control import Control

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import CameraSpec, Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import GlobalPlan

__all__ = ["StoredControls"]


class StoredControls:
    """Gives in each tick what the vehicle got in that tick of `stored`.

    Drive it clean: what the setting did to the controls is in them already.
    """

    portable_bits = True
    consumes: frozenset[str] = frozenset()

    def __init__(self, stored: EpisodeResult) -> None:
        self._told = f"{stored.outcome.value}, {stored.end_detail}"
        rows = zip(*(values.tolist() for values in stored.trace.columns("throttle", "steer", "brake")), strict=True)
        self._controls = tuple(Control(throttle, steer, brake) for throttle, steer, brake in rows)

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Do nothing: the controls are numbered by ticks."""

    def act(self, observation: Observation) -> Control:
        """Return the control of this tick. Raises `IndexError` after the last one."""
        if observation.tick >= len(self._controls):
            raise IndexError(f"the stored episode ended here: {self._told}")
        return self._controls[observation.tick]
