"""Failures of the camera stream: a frozen image, a blocked view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.perturbations.base import EpisodeContext, Perturbation
from pytest_drive_robust.perturbations.bursts import BurstSchedule
from pytest_drive_robust.perturbations.draws import Draws
from pytest_drive_robust.perturbations.severity import (
    checked_choice,
    checked_flag,
    checked_number,
    refusal,
    whole_ticks,
)
from pytest_drive_robust.perturbations.spans import Spans

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import Pixels

__all__ = ["BurstFrameDrop", "PartialObservation"]

_BLUR_PX = (31, 31)
_GRAY = 128


@dataclass
class BurstFrameDrop(Perturbation):
    """A camera link that hangs: for a while the camera repeats its last valid image, and nothing tells the agent.

    Formula: `I~_t = I_t`, or `I_t*` while a burst runs, `t*` being the tick of the last image that was delivered
    valid. Each camera on its own starts a burst in a tick with `probability`; the tick that starts it is already
    stale, and while a burst runs no new one starts. The first image of an episode is always delivered. A stale image
    keeps the tick of its capture.

    Severities: `length_s`, seconds, above 0 (the paper drives 1 and 3); `probability` per camera and tick, 0..1;
    `length`: `"fixed"` is the paper's burst of `length_s`, `"uniform"` the released code's draw of 2 ticks up to
    `length_s`.

    Source: paper, "Camera-Stream Perturbations"; it does not say the probability, 0.01 is the released default (one of
    its figures shows 0.1). What stands after this in the stack, a mask say, is applied to the stale image anew in
    every tick, where the released code freezes the masked image.

    >>> str(BurstFrameDrop(length_s=3))
    '3 s burst frame drop'
    """

    length_s: float = 1.0
    probability: float = 0.01
    length: Literal["fixed", "uniform"] = "fixed"

    phrase: ClassVar[str] = "{length_s} s burst frame drop"

    def __post_init__(self) -> None:
        expected = "seconds above 0 (the paper drives 1 and 3)"
        self.length_s = checked_number(self, "length_s", expected=expected, above_low=True)
        self.probability = checked_number(self, "probability", expected="a probability in 0..1", high=1.0)
        checked_choice(self, "length", ("fixed", "uniform"))

    def reset(self, context: EpisodeContext) -> None:
        """Key the bursts to this episode. Raises `PerturbationError` when a burst is shorter than it can be."""
        self._stream = context.stream
        self._draws = Draws(context.seed, context.route_id, context.stream)
        self._longest_ticks = whole_ticks(self.length_s, context.dt_s)
        shortest_ticks = 2 if self.length == "uniform" else 1
        if self._longest_ticks < shortest_ticks:
            expected = f"at least {shortest_ticks * context.dt_s:g} seconds: a tick lasts {context.dt_s:g} s here"
            raise refusal(self, "length_s", expected)
        self._schedules: dict[str, BurstSchedule] = {}
        self._valid: dict[str, Image] = {}
        self._last_tick = 0

    def observe(self, observation: Observation) -> Observation:
        """The observation with the frozen cameras' images replaced by their last valid ones."""
        self._last_tick = observation.tick
        return observation.map_images(lambda name, image: self._delivered(name, image, observation.tick))

    def schedule(self) -> tuple[Injection, ...]:
        """Every burst of every camera, up to the last observed tick."""
        return tuple(
            Injection(self._stream, camera, first, last)
            for camera, bursts in self._schedules.items()
            for first, last in bursts.until(self._last_tick)
        )

    def _delivered(self, camera: str, image: Image, tick: int) -> Image:
        bursts = self._schedules.get(camera)
        if bursts is None:
            bursts = self._schedules[camera] = BurstSchedule(
                self._draws,
                camera,
                probability=self.probability,
                longest_ticks=self._longest_ticks,
                uniform=self.length == "uniform",
            )
        valid = self._valid.get(camera)
        if valid is not None and bursts.is_frozen(tick):
            return valid
        self._valid[camera] = Image(image.pixels.copy(), image.tick)  # the simulator may reuse its pixels
        return image


@dataclass
class PartialObservation(Perturbation):
    """Mud, a leaf or a damaged lens: a rectangle of every image shows nothing.

    Formula: a rectangle of `int(height * ratio)` by `int(width * ratio)` pixels at a random place, a new one for each
    image of each camera; `hold_s` above 0 keeps a place for so many seconds instead.

    Severities: `ratio`, 0..1 (the paper drives 0.5 and 0.8); with `area` it is the covered share of the image instead
    of the share of each side. `fill`: `"black"` is the paper's text, `"gray"` its figure, `"blur"` the released code's
    default type (Gaussian of 31 x 31 pixels within the rectangle).

    Source: paper, "Camera-Stream Perturbations", which says "mask ratio"; the released code takes it of the sides, so
    0.5 covers 25 % and 0.8 covers 64 % of the image. That reading is the default.

    >>> str(PartialObservation(ratio=0.8)), str(PartialObservation(ratio=0.8, fill="gray"))
    ('occlusion 0.8', 'occlusion 0.8 (fill=gray)')
    """

    ratio: float = 0.5
    area: bool = False
    fill: Literal["black", "gray", "blur"] = "black"
    hold_s: float = 0.0

    phrase: ClassVar[str] = "occlusion {ratio}"

    def __post_init__(self) -> None:
        self.ratio = checked_number(self, "ratio", expected="a share in 0..1 (the paper drives 0.5 and 0.8)", high=1.0)
        self.area = checked_flag(self, "area")
        checked_choice(self, "fill", ("black", "gray", "blur"))
        self.hold_s = checked_number(self, "hold_s", expected="seconds of at least 0")

    def reset(self, context: EpisodeContext) -> None:
        """Key the places to this episode."""
        self._stream = context.stream
        self._draws = Draws(context.seed, context.route_id, context.stream)
        self._hold_ticks = max(1, whole_ticks(self.hold_s, context.dt_s))
        self._spans = Spans()

    def observe(self, observation: Observation) -> Observation:
        """The observation with copies of all images, each with its rectangle filled."""
        drawn_at = observation.tick - observation.tick % self._hold_ticks
        self._spans.touch(observation.tick, observation.cameras)
        return observation.map_images(lambda name, image: self._masked(name, image, drawn_at))

    def schedule(self) -> tuple[Injection, ...]:
        """One stretch for each camera: every observed tick."""
        return self._spans.injections(self._stream)

    def _masked(self, camera: str, image: Image, drawn_at: int) -> Image:
        rows, columns = image.pixels.shape[:2]
        height, width = self._size(rows, columns)
        if height == 0 or width == 0:
            return image
        down, right, _, _ = self._draws.uniform(camera, drawn_at)
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
            import cv2

            rectangle[...] = cv2.GaussianBlur(rectangle, _BLUR_PX, 0)
        else:
            rectangle[...] = 0 if self.fill == "black" else _GRAY
