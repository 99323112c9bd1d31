"""A camera link that hangs: the camera repeats its last valid image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import NO_CAMERA, Draws, EpisodeContext
from pytest_drive_robust.perturbations.severity import checked_choice, checked_number, refusal, whole_ticks


@dataclass
class BurstFrameDrop(Perturbation):
    """A camera link that hangs: for a while the camera repeats its last valid image, and nothing tells the agent.

    Formula: `I~_t = I_t`, or `I_t*` while a burst runs, where `t*` is the tick of the last image that was delivered
    valid. In each tick each camera starts a burst with `probability`, independent of other cameras. The first tick of a
    burst is already stale, and no burst starts while another one runs. The first image of an episode is always
    delivered. A stale image keeps the tick of its capture.

    Severities: `length_s`, seconds, above 0 (the paper drives 1 and 3); `probability` per camera and tick, 0..1;
    `length`: `"fixed"` is the paper's burst of `length_s`, `"uniform"` the released code's draw of 2 ticks up to
    `length_s`.

    Source: paper, "Camera-Stream Perturbations". The paper does not say the probability; 0.01 is the released default
    (a figure of the paper shows 0.1). A later perturbation of the stack, such as a mask, is applied to the stale image
    anew in every tick, where the released code freezes the masked image.

    >>> str(BurstFrameDrop(length_s=3))
    '3 s burst frame drop'
    """

    length_s: float = 1.0
    probability: float = 0.01
    length: Literal["fixed", "uniform"] = "fixed"

    phrase: ClassVar[str] = "{length_s} s burst frame drop"
    readings: ClassVar[Mapping[str, Mapping[str, object]]] = {
        "paper": {"length": "fixed"},
        "released": {"length": "uniform"},
    }
    ladder: ClassVar = ("length_s", (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0))

    def __post_init__(self) -> None:
        expected = "seconds above 0 (the paper drives 1 and 3)"
        self.length_s = checked_number(self, "length_s", expected=expected, above_low=True)
        self.probability = checked_number(self, "probability", expected="a probability in 0..1", high=1.0)
        checked_choice(self, "length", ("fixed", "uniform"))

    def reset(self, context: EpisodeContext) -> None:
        """Key the bursts to this episode. Raises `PerturbationError` when `length_s` is too short for one burst."""
        self._context = context
        self._draws = context.draws()
        self._longest_ticks = whole_ticks(self.length_s, context.dt_s)
        shortest_ticks = 2 if self.length == "uniform" else 1
        if self._longest_ticks < shortest_ticks:
            expected = f"at least {shortest_ticks * context.dt_s:g} seconds: a tick lasts {context.dt_s:g} s here"
            raise refusal(self, "length_s", expected)
        self._schedules: dict[str, BurstSchedule] = {}
        self._valid: dict[str, Image] = {}
        self._last_tick = 0

    def observe(self, observation: Observation) -> Observation:
        """Replace the images of frozen cameras by their last valid ones."""
        self._last_tick = observation.tick
        return observation.map_images(lambda name, image: self._delivered(name, image, observation.tick))

    def schedule(self) -> tuple[Injection, ...]:
        """Return every burst of every camera, up to the last observed tick."""
        return tuple(
            Injection(self._context.stream, camera, first, last)
            for camera, bursts in self._schedules.items()
            for first, last in bursts.until(self._last_tick)
        )

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that there is no camera, or that no burst began."""
        if not cameras:
            return NO_CAMERA
        return f"no burst began (probability {self.probability:g} per camera and tick)"

    def _delivered(self, camera: str, image: Image, tick: int) -> Image:
        bursts = self._schedules.get(camera)
        if bursts is None:
            bursts = self._schedules[camera] = BurstSchedule(
                self._draws,
                self._context.camera_key(camera),
                probability=self.probability,
                longest_ticks=self._longest_ticks,
                uniform=self.length == "uniform",
            )
        valid = self._valid.get(camera)
        if valid is not None and bursts.is_frozen(tick):
            return valid
        kept = Image(image.pixels.copy(), image.tick)  # the simulator may reuse its pixels
        self._valid[camera] = kept.read_only()
        return image


class BurstSchedule:
    """The bursts of one camera as (first tick, last tick) pairs, a pure function of the draws.

    In every tick outside of a burst a new burst starts with `probability`; its first tick belongs to the burst. Tick 0
    never starts a burst, because no earlier image exists. The schedule is worked out tick by tick from tick 1,
    whatever ticks are asked for, so the order of the calls does not matter.

    A burst lasts `longest_ticks`, or 2..`longest_ticks` with equal chances when `uniform`.
    """

    def __init__(self, draws: Draws, sensor: str, *, probability: float, longest_ticks: int, uniform: bool) -> None:
        self._draws = draws
        self._sensor = sensor
        self._probability = probability
        self._longest_ticks = longest_ticks
        self._uniform = uniform
        self._bursts: list[tuple[int, int]] = []
        self._next = 1  # the first tick that is not decided yet

    def is_frozen(self, tick: int) -> bool:
        """Return True when the camera repeats an old image in `tick`."""
        while self._next <= tick:
            self._decide()
        return tick <= next((last for first, last in reversed(self._bursts) if first <= tick), -1)

    def until(self, tick: int) -> list[tuple[int, int]]:
        """Return the bursts that began at or before `tick`, the last one cut off there."""
        self.is_frozen(tick)
        return [(first, min(last, tick)) for first, last in self._bursts if first <= tick]

    def _decide(self) -> None:
        trigger, length, _, _ = self._draws.uniform(self._sensor, self._next)
        ticks = 1
        if trigger < self._probability:
            ticks = 2 + int(length * (self._longest_ticks - 1)) if self._uniform else self._longest_ticks
            self._bursts.append((self._next, self._next + ticks - 1))
        self._next += ticks
