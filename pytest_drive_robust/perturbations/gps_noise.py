"""A satellite receiver among high buildings: noisy positions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from pytest_drive_robust.domain.observation import Gps, Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import EpisodeContext, Spans
from pytest_drive_robust.perturbations.severity import checked_number

__all__ = ["GpsNoise"]


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

    def schedule(self) -> tuple[Injection, ...]:
        """Return one stretch: every observed tick."""
        return self._spans.injections()

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that the noise was too small."""
        return f"noise of {self.std_m:g} m moves no position"
