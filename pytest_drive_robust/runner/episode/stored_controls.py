"""An agent that repeats the controls of a stored episode.

An agent's controls may depend on the processor, the world does not. So the trajectory repeats to the last bit on any
machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan


class StoredControls:
    """An agent that returns given controls, one in each call of `act`, then raises `IndexError`."""

    portable_bits = True

    def __init__(
        self,
        controls: Iterable[Control],
        *,
        cameras: Sequence[CameraSpec] = (),
        consumes: Iterable[str] = (),
        told: str = "",
    ) -> None:
        self.consumes = frozenset(consumes)
        self._cameras = cameras
        self._controls = iter(controls)
        self._told = told

    @classmethod
    def of(cls, stored: EpisodeResult) -> StoredControls:
        """Return an agent that repeats the controls that the vehicle got in each tick of `stored`.

        Drive it under `clean`: the controls already contain the effect of the setting.
        """
        rows = zip(*(values.tolist() for values in stored.trace.columns("throttle", "steer", "brake")), strict=True)
        return cls((Control(*row) for row in rows), told=f": {stored.outcome.value}, {stored.end_detail}")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the cameras given to the constructor."""
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Do nothing: the controls begin with the first tick."""

    def act(self, observation: Observation) -> Control:
        """Return the next control."""
        control = next(self._controls, None)
        if control is None:
            raise IndexError(f"the stored episode ended here{self._told}")
        return control
