"""What the closed loop tells while it runs: whose code runs, what was driven, which error ended it."""

from __future__ import annotations

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.truth import WorldState


class Watch:
    """Is told whose code runs and what was driven, so that a crash or a hang is blamed on the right code.

    The phases are `"reset"` (the agent's `sensors`, `consumes` and `reset`), `"act"` (the agent's `act`) and `"sim"`
    (everything else: the world, the perturbations, the recorder). Methods are called in every tick and must return at
    once. An error in a method counts as a fault of the simulation.
    """

    def phase(self, name: str, tick: int) -> None:
        """Note that the phase `name` begins in `tick`."""

    def equip(self, cameras: tuple[CameraSpec, ...], consumes: tuple[str, ...], *, privileged: bool) -> None:
        """Note the agent's cameras, its signals, and whether it sees ground truth, at the start of an episode."""

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        """Note a driven tick.

        `state` is the world at the time of the observation, `observation` the perturbed observation, of which the agent
        had its own copy, `asked` the agent's answer, None when the agent was not asked, and `applied` the control that
        the vehicle got.
        """

    def failed(self, error: Exception) -> None:
        """Note the error that ends the episode."""
