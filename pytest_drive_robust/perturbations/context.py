"""What a perturbation knows of the episode that begins, and what it notes for the record."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.draws import Draws

__all__ = ["NO_CAMERA", "EpisodeContext", "Spans", "cameras_by_name"]

NO_CAMERA = "the agent has no camera"
"""Why a failure of cameras changed nothing."""


@dataclass(frozen=True, slots=True)
class EpisodeContext:
    """What a perturbation may know of an episode: never the agent, never the ground truth, never the future.

    `cameras` are those of the agent in the order of its rig. `stream` names the perturbation within its stack
    (`"gps-noise"`, a second one `"gps-noise#2"`), so that two of a kind draw different noise.
    """

    route_id: str
    seed: int
    dt_s: float
    cameras: tuple[CameraSpec, ...]
    stream: str

    def draws(self) -> Draws:
        """Return the random numbers of this perturbation in this episode."""
        return Draws(self.seed, self.route_id, self.stream)

    def camera_key(self, name: str) -> str:
        """Return what the draws for a camera are asked by: its position in the rig, `"camera 0"` for the first one.

        Agents name their cameras as they like, `front` or `CAM_FRONT`; the position makes them meet the same pattern.
        Raises `PerturbationError` for a camera that the rig does not have.
        """
        for position, camera in enumerate(self.cameras):
            if camera.name == name:
                return f"camera {position}"
        rig = ", ".join(camera.name for camera in self.cameras) or "none"
        raise PerturbationError(
            f"{self.stream} got an image of the camera {name!r}, expected one of the agent's rig: {rig}."
        )


class Spans:
    """The ticks that a perturbation touched, for perturbations that work in every tick.

    Kept are the first tick of each signal and the last tick of all, in the order in which the signals came up.
    """

    __slots__ = ("_first", "_last", "_stream")

    def __init__(self, stream: str) -> None:
        self._stream = stream
        self._first: dict[str, int] = {}
        self._last = 0

    def touch(self, tick: int, signals: Iterable[str]) -> None:
        """Note that `signals` were perturbed in `tick`."""
        for signal in signals:
            self._first.setdefault(signal, tick)
        self._last = tick

    def injections(self) -> tuple[Injection, ...]:
        """Return one stretch for each signal: from its first tick to the last tick of the episode."""
        return tuple(Injection(self._stream, signal, first, self._last) for signal, first in self._first.items())


def cameras_by_name(names: tuple[str, ...]) -> str:
    """Return the cameras for a sentence: `"the camera front"`, `"the cameras front, rear"`."""
    return f"the camera {names[0]}" if len(names) == 1 else f"the cameras {', '.join(names)}"
