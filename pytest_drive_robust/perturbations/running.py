"""The perturbations of one episode at work, on both seams."""

from __future__ import annotations

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.base import Perturbation

__all__ = ["RunningStack"]


class RunningStack:
    """The reset copies of a setting's perturbations. Made by `Setting.start`, used for one episode.

    A perturbation costs nothing on a seam that its class does not override, so the clean stack gives back the very
    objects that it gets.
    """

    __slots__ = ("_actuate", "_last", "_observe", "_perturbations", "_wants")

    def __init__(self, perturbations: tuple[Perturbation, ...]) -> None:
        self._perturbations = perturbations
        self._observe = [item.observe for item in perturbations if _overrides(item, "observe")]
        self._wants = [item.wants_inference for item in perturbations if _overrides(item, "wants_inference")]
        self._actuate = [item.actuate for item in perturbations if _overrides(item, "actuate")]
        self._last = Control.NEUTRAL

    @property
    def warmup_ticks(self) -> int:
        """For so many ticks the vehicle gets neutral commands: the longest of the stack, 0 if there is none."""
        return max((int(getattr(item, "warmup_ticks", 0)) for item in self._perturbations), default=0)

    @property
    def measures_inference(self) -> bool:
        """True when the wall time of inference decides what happens: such an episode repeats only as a replay."""
        return any(bool(getattr(item, "measures_inference", False)) for item in self._perturbations)

    @property
    def inference_s(self) -> tuple[float, ...]:
        """The inference times in seconds that the episode used (measured or replayed), empty when none did."""
        times = (tuple(getattr(item, "inference_s", ())) for item in self._perturbations)
        return next(filter(None, times), ())

    def observe(self, observation: Observation) -> Observation:
        """The observation that the agent gets. The arrays of the argument are not written to."""
        for change in self._observe:
            observation = change(observation)
            if not isinstance(observation, Observation):
                raise PerturbationError(f"{change.__qualname__} gave {observation!r}, expected an Observation")
        return observation

    def wants_inference(self, tick: int) -> bool:
        """True when no perturbation keeps the agent's computer busy in `tick`."""
        return all(free(tick) for free in self._wants)

    def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control:
        """The control that the vehicle gets: the last one again when there is no new one, neutral before the first."""
        for change in self._actuate:
            control = change(tick, control, inference_s)
        if control is not None:
            self._last = control
        return self._last

    def schedule(self) -> tuple[Injection, ...]:
        """What was injected so far, perturbation by perturbation."""
        return tuple(injection for item in self._perturbations for injection in item.schedule())


def _overrides(perturbation: Perturbation, method: str) -> bool:
    return getattr(type(perturbation), method) is not getattr(Perturbation, method)
