"""Mud, a leaf or a damaged lens: a rectangle of every image shows nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import NO_CAMERA, EpisodeContext, Spans, cameras_by_name
from pytest_drive_robust.perturbations.severity import checked_choice, checked_flag, checked_number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.observation import Pixels

_GRAY = 128
_TAPS = (20, 20, 19, 17, 15, 13, 10, 7, 6, 4, 3, 2, 1, 0, 1)
"""Right half of OpenCV's Gaussian of 31 taps (sigma 5) in 256ths, its rounding errors carried on from the outside."""


@dataclass
class PartialObservation(Perturbation):
    """Mud, a leaf or a damaged lens: a rectangle of every image shows nothing.

    Formula: a rectangle of `int(height * ratio)` by `int(width * ratio)` pixels at a random place. Each camera gets a
    new place in each tick, also when its image repeats.

    Severities: `ratio`, 0..1 (the paper drives 0.5 and 0.8), is the share of each side of the image; with `area`, the
    covered share of the image. `fill`: `"black"` is the paper's text, `"gray"` its figure, `"blur"` the released code's
    default type (Gaussian of 31 x 31 pixels within the rectangle).

    Source: paper, "Camera-Stream Perturbations", which says "mask ratio". The released code applies the ratio to the
    sides, so 0.5 covers 25 % and 0.8 covers 64 % of the image. That is the default in both readings.

    >>> str(PartialObservation(ratio=0.8)), str(PartialObservation(ratio=0.8, fill="gray"))
    ('occlusion 0.8', 'occlusion 0.8 (fill=gray)')
    """

    ratio: float = 0.5
    area: bool = False
    fill: Literal["black", "gray", "blur"] = "black"

    phrase: ClassVar[str] = "occlusion {ratio}"
    readings: ClassVar[Mapping[str, Mapping[str, object]]] = {"released": {"area": False}}
    ladder: ClassVar = ("ratio", tuple(step / 10.0 for step in range(1, 11)))

    def __post_init__(self) -> None:
        self.ratio = checked_number(self, "ratio", expected="a share in 0..1 (the paper drives 0.5 and 0.8)", high=1.0)
        self.area = checked_flag(self, "area")
        checked_choice(self, "fill", ("black", "gray", "blur"))

    def reset(self, context: EpisodeContext) -> None:
        """Key the places to this episode."""
        self._context = context
        self._draws = context.draws()
        self._spans = Spans(context.stream)

    def observe(self, observation: Observation) -> Observation:
        """Replace all images by copies, each with its rectangle filled."""
        self._spans.touch(observation.tick, observation.cameras)
        return observation.map_images(lambda name, image: self._masked(name, image, observation.tick))

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that there is no camera, or that the rectangle hides nothing."""
        if not cameras:
            return NO_CAMERA
        return f"a rectangle of {self.ratio:g} covers nothing that could be seen in {cameras_by_name(cameras)}"

    def _masked(self, camera: str, image: Image, tick: int) -> Image:
        rows, columns = image.pixels.shape[:2]
        height, width = self._size(rows, columns)
        if height == 0 or width == 0:
            return image
        down, right, _, _ = self._draws.uniform(self._context.camera_key(camera), tick)
        top = int(down * (rows - height + 1))
        left = int(right * (columns - width + 1))
        pixels = image.pixels.copy()
        self._cover(pixels[top : top + height, left : left + width])
        return Image(pixels, image.tick)

    def _size(self, rows: int, columns: int) -> tuple[int, int]:
        if not self.area:
            return int(rows * self.ratio), int(columns * self.ratio)
        height = round(rows * math.sqrt(self.ratio))
        return height, min(columns, round(rows * columns * self.ratio / max(1, height)))

    def _cover(self, rectangle: Pixels) -> None:
        if self.fill == "blur":
            rectangle[...] = blurred(rectangle)
        else:
            rectangle[...] = 0 if self.fill == "black" else _GRAY


def blurred(pixels: Pixels) -> Pixels:
    """Blur (height, width, 3) uint8 by 31 x 31 pixels, mirrored at the edges: what `cv2.GaussianBlur` gives today."""
    import numpy as np

    across = _weighted(pixels.swapaxes(0, 1), np.uint16)  # at most 255 * 256
    down = _weighted(across.swapaxes(0, 1), np.uint32)
    return np.asarray((down + np.uint32(1 << 15)) >> np.uint32(16), np.uint8)


def _weighted(values: NDArray[np.unsignedinteger], kind: type[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """Return the sums along the first axis, weighted by `_TAPS`, as numbers of the type `kind`."""
    import numpy as np

    reach, count = len(_TAPS) - 1, len(values)
    wide = values[_mirrored(count, reach)].astype(kind)
    total = wide[reach : reach + count] * kind(_TAPS[0])
    for step, tap in enumerate(_TAPS[1:], 1):
        if tap:
            total += (wide[reach - step : reach - step + count] + wide[reach + step : reach + step + count]) * kind(tap)
    return np.asarray(total)


def _mirrored(count: int, reach: int) -> NDArray[np.int64]:
    """Return the indices of `count` places plus `reach` at both ends, mirrored without repeating the edge."""
    import numpy as np

    places = np.arange(-reach, count + reach)
    period = max(2 * (count - 1), 1)
    places %= period
    return np.where(places < count, places, period - places)
