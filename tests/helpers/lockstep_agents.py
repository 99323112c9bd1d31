"""Agents with `act_batch` for the tests of lockstep, and how to compare what they drive."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.driver import EpisodeDriver
from pytest_drive_robust.runner.lockstep.batch import WIDTH
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.store.record import encode_episode
from pytest_drive_robust.testing import fake_route

Floats = NDArray[np.float64]

CAMERA = CameraSpec("front", width_px=6, height_px=4)
_RNG = np.random.default_rng(7)
HIDDEN = _RNG.normal(size=(8, 24))
OUT = _RNG.normal(size=(24, 3))
FAULTS = {901: "raise", 902: "nan", 903: "give", 904: "reset"}
"""What an agent does wrong in tick 9 of episodes with these seeds."""


class Net:
    """A small recurrent network, the same sums in the same order for every row. Some seeds make it break."""

    def sensors(self) -> list[CameraSpec]:
        return [CAMERA]

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.fault = FAULTS.get(seed, "")
        self.memory = np.array([route.points[-1].x_m / 100.0, seed % 7, 0.0])
        if self.fault == "reset":
            raise OSError("no memory left")

    def act(self, observation: Observation) -> Control:
        (control,) = self.act_batch([self], [observation])
        if isinstance(control, Exception):
            raise control
        return control

    @classmethod
    def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
        inputs = np.array([agent.features(seen) for agent, seen in zip(agents, observations, strict=True)])
        outputs = cls.forward(inputs)
        for agent, row in zip(agents, outputs, strict=True):
            agent.memory = row
        return [agent.control(seen) for agent, seen in zip(agents, observations, strict=True)]

    @staticmethod
    def forward(inputs: Floats) -> Floats:
        hidden = np.tanh(np.einsum("bi,io->bo", inputs, HIDDEN))
        outputs: Floats = np.tanh(np.einsum("bi,io->bo", hidden, OUT))
        return outputs

    def features(self, seen: Observation) -> list[float]:
        red = float(seen.cameras["front"].pixels[..., 0].mean()) / 255.0
        return [seen.gps.x_m / 50.0, seen.gps.y_m, seen.speed.mps / 10.0, seen.compass.yaw_rad, red, *self.memory]

    def control(self, seen: Observation) -> Control:
        throttle, steer, _ = (float(value) for value in self.memory)
        if self.fault and seen.tick == 9:
            if self.fault == "raise":
                raise ZeroDivisionError("no way")
            if self.fault == "give":
                return ZeroDivisionError("not my way")  # type: ignore[return-value]
            return Control(throttle=float("nan"))
        return Control(throttle=0.75 + 0.25 * throttle, steer=0.02 * steer)


def task(*, metres: float = 20.0, seed: int = 0, setting: str = "clean", agent: str = "net") -> EpisodeRequest:
    route, parsed = fake_route(f"{metres:g}", length_m=metres), Setting.parse(setting)
    return EpisodeRequest(Episode(agent, route.id, str(parsed), seed), route, parsed)


def bits(result: EpisodeResult) -> bytes:
    """Return the record of an episode, but for the clock and the words about how it was driven."""
    return encode_episode(replace(result, wall_s=0.0, versions={}))


def taking(requests: Iterable[EpisodeRequest]) -> Callable[[], EpisodeRequest | None]:
    """Return what gives one after the other, then None."""
    iterator = iter(requests)
    return lambda: next(iterator, None)


def drive_together(
    make_world: Callable[[], Simulator],
    make_agent: Callable[[], Agent],
    requests: Sequence[EpisodeRequest],
    *,
    width: int = WIDTH,
) -> list[EpisodeResult]:
    """Drive `requests`, `width` at a time, and give their results in the order of `requests`."""
    driver = EpisodeDriver(make_world, lambda name: make_agent())
    try:
        driving = driver.drive_batch(requests[0].episode.agent, taking(requests), width, check=False)
        results = {id(request): result for request, result in driving}
    finally:
        driver.close()
    return [results[id(request)] for request in requests]
