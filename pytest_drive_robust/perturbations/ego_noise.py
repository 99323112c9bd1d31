"""Noise on the ego's own state: a satellite receiver among high buildings, a wheel-speed sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from pytest_drive_robust.domain.observation import Gps, Observation, Speed
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import EpisodeContext, Spans
from pytest_drive_robust.perturbations.severity import checked_flag, checked_number


@dataclass
class GpsNoise(Perturbation):
    """A satellite receiver among high buildings: every fix is off by an independent error.

    Formula: `(x, y) + N(0, std_m^2 I)`, drawn anew in every tick (no drift). Severity `std_m`: metres, 0 or more; the
    paper drives 5 and 15, which the released code calls medium and severe.

    Source: paper, "Ego-State Noise". Horizontal only, as the released code has it. The error is added in metres;
    latitude and longitude follow by the simulator's own projection, where the released code divides by 111000 m per
    degree (a difference of 0.3 %).

    >>> str(GpsNoise(std_m=5))
    'GPS noise 5 m'
    """

    std_m: float = 5.0

    phrase: ClassVar[str] = "GPS noise {std_m} m"
    ladder: ClassVar = ("std_m", (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 50.0))

    def __post_init__(self) -> None:
        self.std_m = checked_number(self, "std_m", expected="metres of at least 0 (the paper drives 5 and 15)")

    def reset(self, context: EpisodeContext) -> None:
        """Key the noise to this episode."""
        self._draws = context.draws()
        self._spans = Spans(context.stream)

    def observe(self, observation: Observation) -> Observation:
        """Return the observation with a noisy GPS; the tick of capture stays."""
        east, south, _, _ = self._draws.normal("gps", observation.tick)
        self._spans.touch(observation.tick, ("gps",))
        gps = observation.gps
        noisy = Gps(gps.x_m + self.std_m * east, gps.y_m + self.std_m * south, gps.tick)
        return replace(observation, gps=noisy)

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that the noise was too small."""
        return f"noise of {self.std_m:g} m moves no position"


@dataclass
class SpeedNoise(Perturbation):
    """A wheel-speed sensor with a wrong scale: the agent believes that it drives slower than it does.

    Formula: `eta * v` with `eta ~ N(mean, std^2)`, drawn anew in every tick. Severities: `mean` and `std`, factors
    without unit, 0 or more; the paper drives mean 0.5 and 0.2 with std 0.2. `clip` keeps eta at 0 or above.

    Source: paper, "Ego-State Noise"; the released code is the same. Neither clips, so without `clip` the reported
    speed is negative in 0.6 % of the ticks at mean 0.5 and in 15.9 % at mean 0.2.

    >>> str(SpeedNoise(mean=0.2)), str(SpeedNoise(mean=0.2, clip=True))
    ('speed noise 0.2', 'speed noise 0.2 (clip=true)')
    """

    mean: float = 0.5
    std: float = 0.2
    clip: bool = False

    phrase: ClassVar[str] = "speed noise {mean}"
    ladder: ClassVar = ("mean", tuple(step / 10.0 for step in range(9, -1, -1)))

    def __post_init__(self) -> None:
        self.mean = checked_number(self, "mean", expected="a factor of at least 0 (the paper drives 0.5 and 0.2)")
        self.std = checked_number(self, "std", expected="a factor of at least 0 (the paper drives 0.2)")
        self.clip = checked_flag(self, "clip")

    def reset(self, context: EpisodeContext) -> None:
        """Key the noise to this episode."""
        self._draws = context.draws()
        self._spans = Spans(context.stream)

    def observe(self, observation: Observation) -> Observation:
        """Return the observation with a scaled speed; the tick of capture stays."""
        factor = self.mean + self.std * self._draws.normal("speed", observation.tick)[0]
        if self.clip:
            factor = max(0.0, factor)
        self._spans.touch(observation.tick, ("speed",))
        return replace(observation, speed=Speed(factor * observation.speed.mps, observation.speed.tick))

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that the factor is 1, or that there was no speed to scale."""
        if self.mean == 1.0 and self.std == 0.0:
            return "a factor of 1 changes no speed"
        return "the vehicle never moved, and a factor of no speed is no speed"
