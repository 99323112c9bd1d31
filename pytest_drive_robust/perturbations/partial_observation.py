"""Mud, a leaf or a damaged lens: a rectangle of every image shows nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import NO_CAMERA, EpisodeContext, Spans, cameras_by_name
from pytest_drive_robust.perturbations.gaussian_blur import blurred
from pytest_drive_robust.perturbations.severity import checked_choice, checked_flag, checked_number, whole_ticks

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import Pixels

__all__ = ["PartialObservation"]

_GRAY = 128


@dataclass
class PartialObservation(Perturbation):
    """Mud, a leaf or a damaged lens: a rectangle of every image shows nothing.

    Formula: a rectangle of `int(height * ratio)` by `int(width * ratio)` pixels at a random place, a new one for each
    image of each camera; `hold_s` above 0 keeps a place for so many seconds instead.

    Severities: `ratio`, 0..1 (the paper drives 0.5 and 0.8); with `area` it is the covered share of the image instead
    of the share of each side. `fill`: `"black"` is the paper's text, `"gray"` its figure, `"blur"` the released code's
    default type (Gaussian of 31 x 31 pixels within the rectangle).

    Source: paper, "Camera-Stream Perturbations", which says "mask ratio"; the released code takes it of the sides, so
    0.5 covers 25 % and 0.8 covers 64 % of the image. That is the default in either reading.

    >>> str(PartialObservation(ratio=0.8)), str(PartialObservation(ratio=0.8, fill="gray"))
    ('occlusion 0.8', 'occlusion 0.8 (fill=gray)')
    """

    ratio: float = 0.5
    area: bool = False
    fill: Literal["black", "gray", "blur"] = "black"
    hold_s: float = 0.0

    phrase: ClassVar[str] = "occlusion {ratio}"
    readings: ClassVar[Mapping[str, Mapping[str, object]]] = {"released": {"area": False}}
    ladder: ClassVar = ("ratio", tuple(step / 10.0 for step in range(1, 11)))

    def __post_init__(self) -> None:
        self.ratio = checked_number(self, "ratio", expected="a share in 0..1 (the paper drives 0.5 and 0.8)", high=1.0)
        self.area = checked_flag(self, "area")
        checked_choice(self, "fill", ("black", "gray", "blur"))
        self.hold_s = checked_number(self, "hold_s", expected="seconds of at least 0")

    def reset(self, context: EpisodeContext) -> None:
        """Key the places to this episode."""
        self._context = context
        self._draws = context.draws()
        self._hold_ticks = max(1, whole_ticks(self.hold_s, context.dt_s))
        self._spans = Spans(context.stream)

    def observe(self, observation: Observation) -> Observation:
        """Replace all images by copies, each with its rectangle filled."""
        drawn_at = observation.tick - observation.tick % self._hold_ticks
        self._spans.touch(observation.tick, observation.cameras)
        return observation.map_images(lambda name, image: self._masked(name, image, drawn_at))

    def schedule(self) -> tuple[Injection, ...]:
        """Return one stretch for each camera: every observed tick."""
        return self._spans.injections()

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that there is no camera, or that the rectangle hides nothing."""
        if not cameras:
            return NO_CAMERA
        return f"a rectangle of {self.ratio:g} covers nothing that could be seen in {cameras_by_name(cameras)}"

    def _masked(self, camera: str, image: Image, drawn_at: int) -> Image:
        rows, columns = image.pixels.shape[:2]
        height, width = self._size(rows, columns)
        if height == 0 or width == 0:
            return image
        down, right, _, _ = self._draws.uniform(self._context.camera_key(camera), drawn_at)
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
