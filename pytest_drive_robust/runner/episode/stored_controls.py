"""An agent that gives the controls of an earlier drive again.

What drove may depend on the processor; the world does not. So the trajectory comes back to the last bit on any machine,
with or without whoever drove.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import GlobalPlan

__all__ = ["AgentRig", "StoredControls"]


@dataclass(frozen=True, slots=True)
class AgentRig:
    """What is known of an agent that can no longer be asked."""

    cameras: tuple[CameraSpec, ...] = ()
    consumes: tuple[str, ...] = ()
    privileged: bool = False


class StoredControls:
    """Gives one control after the other, then raises `IndexError`, as in the call `lost_in` where that came first.

    It has the cameras of `rig`, and no privilege: nobody reads the truth, which would be copied in every tick.
    """

    portable_bits = True

    def __init__(
        self, controls: Iterable[Control], *, rig: AgentRig | None = None, lost_in: str = "act", told: str = ""
    ) -> None:
        self.consumes = frozenset(() if rig is None else rig.consumes)
        self._cameras = () if rig is None else rig.cameras
        self._controls = iter(controls)
        self._lost_in = lost_in
        self._told = told

    @classmethod
    def of(cls, stored: EpisodeResult) -> StoredControls:
        """Return one that gives what the vehicle got in each tick of `stored`.

        Drive it clean: what the setting did to the controls is in them already.
        """
        rows = zip(*(values.tolist() for values in stored.trace.columns("throttle", "steer", "brake")), strict=True)
        return cls((Control(*row) for row in rows), told=f"{stored.outcome.value}, {stored.end_detail}")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the cameras of the rig."""
        self._raise_in("sensors")
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Do nothing: the first control is that of the first tick."""
        self._raise_in("reset")

    def act(self, observation: Observation) -> Control:
        """Return the next control."""
        control = next(self._controls, None)
        if control is None:
            raise IndexError(f"the stored episode ended here: {self._told}")
        return control

    def _raise_in(self, call: str) -> None:
        if self._lost_in == call:
            raise IndexError(f"the stored episode ended in {call}")
