"""A setting while it runs: its perturbations on both seams of one episode, and what they may answer."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Mapping, Sequence

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.context import EpisodeContext
from pytest_drive_robust.perturbations.sentence_forms import kebab_name


class RunningStack:
    """The perturbations of a setting at work on both seams of one episode.

    A perturbation costs nothing on a seam that its class does not override, so the clean stack returns the same objects
    that it gets.
    """

    __slots__ = ("_actuate", "_last", "_observe", "_perturbations", "_wants")

    def __init__(self, perturbations: tuple[Perturbation, ...]) -> None:
        self._perturbations = perturbations
        self._observe = [item.observe for item in perturbations if _overrides(item, "observe")]
        self._wants = [item.wants_inference for item in perturbations if _overrides(item, "wants_inference")]
        self._actuate = [item.actuate for item in perturbations if _overrides(item, "actuate")]
        self._last = Control.NEUTRAL

    @classmethod
    def of(
        cls, setting: Setting, *, route_id: str, seed: int, dt_s: float, cameras: Sequence[CameraSpec]
    ) -> RunningStack:
        """Copy and reset the perturbations for one episode. Raises `PerturbationError` from their `reset`."""
        counts: Counter[str] = Counter()
        running = []
        for perturbation in setting.perturbations:
            name = kebab_name(type(perturbation))
            counts[name] += 1
            stream = name if counts[name] == 1 else f"{name}#{counts[name]}"
            own = copy.deepcopy(perturbation)
            own.reset(EpisodeContext(route_id, seed, dt_s, tuple(cameras), stream))
            running.append(own)
        return cls(tuple(running))

    @property
    def observes(self) -> bool:
        """True when a perturbation overrides `observe`."""
        return bool(self._observe)

    @property
    def inference_s(self) -> tuple[float, ...]:
        """The inference times in seconds that the episode used (measured or replayed), empty when none did."""
        times = (tuple(getattr(item, "inference_s", ())) for item in self._perturbations)
        return next(filter(None, times), ())

    def observe(self, observation: Observation) -> Observation:
        """Return the observation that the agent gets. The arrays of the argument are not written to.

        Raises `PerturbationError` when a perturbation gives no valid observation of this tick.
        """
        for change in self._observe:
            given, observation = observation, change(observation)
            if observation is given:
                continue
            problem = observation_problem(given, observation)
            if problem is not None:
                raise PerturbationError(f"{change.__qualname__} {problem}")
        return observation

    def wants_inference(self, tick: int) -> bool:
        """Return True when no perturbation keeps the agent's computer busy in `tick`."""
        for free in self._wants:
            answer: object = free(tick)
            if answer is True:
                continue
            problem = inference_problem(answer)
            if problem is not None:
                raise PerturbationError(f"{free.__qualname__} {problem}")
            if not answer:
                return False
        return True

    def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control:
        """Return the control that the vehicle gets: the new one, else the last one, else the neutral one."""
        for change in self._actuate:
            control = change(tick, control, inference_s)
        if control is not None:
            self._last = control
        return self._last

    def schedule(self) -> tuple[Injection, ...]:
        """Return what was injected so far, perturbation by perturbation."""
        return tuple(injection for item in self._perturbations for injection in item.schedule())


def observation_problem(given: Observation, got: object) -> str | None:
    """Return in a clause what is wrong with `got`, which `observe` returned for `given`; None for nothing.

    The agent would be blamed for an observation that it cannot take.
    """
    if not isinstance(got, Observation):
        return f"gave {got!r}, expected an Observation"
    if got.tick != given.tick:  # later perturbations of the stack draw and count by the tick
        return (
            f"gave the observation of tick {got.tick!r} in tick {given.tick}: give the signals of another tick, not "
            "the observation: dataclasses.replace(observation, gps=earlier.gps)"
        )
    problem = got.signal_problem()
    if problem is not None:
        return f"gave an observation whose {problem}"
    return None if got.cameras is given.cameras else _images_problem(given.cameras, got.cameras)


def _images_problem(given: Mapping[str, Image], got: Mapping[str, Image]) -> str | None:
    if got.keys() != given.keys():
        return f"gave images of {sorted(got)}, expected those of {sorted(given)}"
    for name, image in got.items():
        before = given[name]
        if image is before:
            continue
        if not isinstance(image, Image):
            return f"gave a {type(image).__name__} for the camera {name!r}, expected an Image"
        shape, kind = getattr(image.pixels, "shape", None), getattr(image.pixels, "dtype", None)
        if shape != before.pixels.shape or kind != before.pixels.dtype:
            pixels = f"as a {type(image.pixels).__name__}" if shape is None else f"{shape} {kind}"
            expected = f"{before.pixels.shape} {before.pixels.dtype}"
            return f"gave pixels {pixels} for the camera {name!r}, expected {expected}"
    return None


def inference_problem(answer: object) -> str | None:
    """Return in a clause what is wrong with an answer of `wants_inference`; None for True and False.

    None is no answer: a forgotten `return` gives it.
    """
    if answer is True or answer is False:
        return None
    import numpy as np

    if isinstance(answer, (int, np.bool_, np.integer)):
        return None
    return f"gave {answer!r}, expected True or False: is there a return in every branch?"


def _overrides(perturbation: Perturbation, method: str) -> bool:
    return getattr(type(perturbation), method) is not getattr(Perturbation, method)
