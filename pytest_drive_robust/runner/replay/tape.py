"""What one episode looked like, moment by moment: enough to draw it again, small enough to keep."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.agent import PlannedPath
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Image, Pixels
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.truth import LaneMap, WorldState

__all__ = ["Picture", "Tape", "TapeTick", "main_camera"]

_WIDEST_PX = 640
_JPEG_QUALITY = 92


def main_camera(names: Iterable[str]) -> str:
    """Return the camera to show in large: the one named `front`, else the middle one. There must be one."""
    listed = list(names)
    return "front" if "front" in listed else listed[len(listed) // 2]


@dataclass(frozen=True, slots=True)
class Picture:
    """One image of a moment as a JPEG, no wider than a panel of a film needs it; `tick` is the tick of its capture."""

    camera: str
    tick: int
    jpeg: bytes = field(repr=False)

    @classmethod
    def of(cls, camera: str, image: Image) -> Picture:
        """Compress an image of that camera."""
        import cv2
        import numpy as np

        pixels = image.pixels[:, :, ::-1]
        height, width = pixels.shape[:2]
        if width > _WIDEST_PX:
            size = (_WIDEST_PX, max(1, round(height * _WIDEST_PX / width)))
            pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
        jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
        return cls(camera, image.tick, jpeg)

    def pixels(self) -> Pixels:
        """Return (height, width, 3) uint8 RGB."""
        import cv2
        import numpy as np

        decoded = np.asarray(cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)
        return np.ascontiguousarray(decoded[:, :, ::-1])


@dataclass(frozen=True, slots=True)
class TapeTick:
    """The world at the beginning of a tick, and what agent and vehicle did in it.

    `pictures`, `gps` (x, y in metres) and `speed_mps` are what the agent was given; `real` is what its main camera
    would have shown where that is something else. `asked` is the agent's newest control (None before its first),
    `applied` what the vehicle got; `plan` holds the agent's newest plan with its points in metres of the world. The
    last moment of a tape is the end: nothing is asked or applied any more.
    """

    state: WorldState
    pictures: tuple[Picture, ...] = ()
    real: Picture | None = None
    gps: tuple[float, float] | None = None
    speed_mps: float | None = None
    asked: Control | None = None
    applied: Control | None = None
    plan: PlannedPath | None = None


@dataclass(frozen=True, slots=True)
class Tape:
    """One recorded episode: its result and `result.ticks + 1` moments, fewer when the world broke.

    `route` is (n, 4) as in `GroundTruth`. `shown_only` is True when the pictures were made for people, because the
    agent has no camera. `plan_problem` says why no plan is shown although the agent has one, else it is empty.
    """

    result: EpisodeResult
    moments: tuple[TapeTick, ...]
    lane_map: LaneMap
    route: NDArray[np.float64]
    shown_only: bool = False
    plan_problem: str = ""

    def images(self, position: int) -> dict[str, tuple[Pixels, int]]:
        """Return the pictures of a moment by camera, (height, width, 3) uint8 RGB, each with its tick of capture."""
        return {item.camera: (item.pixels(), item.tick) for item in self.moments[position].pictures}

    def real(self, position: int) -> Pixels | None:
        """Return what the main camera would have shown, where the agent was given something else."""
        picture = self.moments[position].real
        return None if picture is None else picture.pixels()
