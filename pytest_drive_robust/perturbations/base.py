"""What every perturbation is: a dataclass of its severities that touches one of the two seams.

Write your own in ten lines: inherit from `Perturbation`, give it a `phrase`, override what you touch::

    @dataclass
    class Dimmed(Perturbation):
        \"\"\"An ageing image sensor: every pixel at `gain` (0..1) of its brightness.\"\"\"

        gain: float = 0.5
        phrase = "dimmed camera {gain}"

        def observe(self, observation):
            return observation.map_images(
                lambda name, image: Image((image.pixels * self.gain).astype("uint8"), image.tick)
            )
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.result import Injection

if TYPE_CHECKING:
    from pytest_drive_robust.perturbations.setting import Setting

__all__ = ["EpisodeContext", "Perturbation"]


@dataclass(frozen=True, slots=True)
class EpisodeContext:
    """What a perturbation may know of an episode: never the agent, never the ground truth, never the future.

    `stream` names the perturbation within its stack (`"gps-noise"`, a second one `"gps-noise#2"`), so that two of a
    kind draw different noise.
    """

    route_id: str
    seed: int
    dt_s: float
    cameras: tuple[CameraSpec, ...]
    stream: str


@dataclass
class Perturbation:
    """Base of all perturbations: the identity on both seams, `+` to stack, and a sentence for people.

    The dataclass fields are the severities, with their unit in the name. The runner copies the object for every
    episode, so `reset` may keep state in ordinary attributes.

    `phrase` is the sentence form with the fields that it shows: `"{ms} ms latency"`. It is used in both directions:
    for `str()` and by the requirement parser. Fields that the phrase does not show follow in brackets when they
    differ from their defaults: `"200 ms latency (mode=hold)"`.

    An optional `ladder = ("gain", (0.9, 0.5, 0.1))` names the severity that searches and strategies step through, and
    its values from mild to severe (see `perturbations.ladder`).
    """

    phrase: ClassVar[str] = ""

    def reset(self, context: EpisodeContext) -> None:
        """An episode begins. Override to build the state that the other methods need."""

    def observe(self, observation: Observation) -> Observation:
        """The observation that the agent gets instead of this one. Must not write into the arrays of its argument."""
        return observation

    def wants_inference(self, tick: int) -> bool:
        """False while the agent's computer is busy: then `act` is not called in this tick."""
        return True

    def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
        """The control that reaches the vehicle. `control` is None when the agent was not asked in this tick.

        `inference_s` is the wall time of `act` in seconds (0.0 when it was not called). Returning None holds the last
        control that reached the vehicle.
        """
        return control

    def schedule(self) -> tuple[Injection, ...]:
        """What was injected so far, for the record. Called once, at the end of the episode."""
        return ()

    def parameters(self) -> dict[str, object]:
        """The severities by name, defaults included, in the order of their declaration."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.init}

    def __add__(self, other: Perturbation | Setting) -> Setting:
        """Stack two failures: `BurstFrameDrop(length_s=3) + InferenceLatency(ms=200)`."""
        from pytest_drive_robust.perturbations.setting import Setting

        return Setting.of(self) + other

    def __str__(self) -> str:
        from pytest_drive_robust.perturbations.phrase import render

        return render(self)
