"""Sensors that arrive late."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import ClassVar

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import NO_CAMERA, EpisodeContext, Spans
from pytest_drive_robust.perturbations.severity import checked_number, delay_ticks, whole_ticks

_EGO_SIGNALS = ("gps", "compass", "imu", "speed")


@dataclass
class SensorDelay(Perturbation):
    """A slow bus or image encoder: the agent sees the world as it was some time ago.

    Formula: cameras deliver what was captured `floor(camera_ms / 1000 / dt)` ticks ago; GPS, compass, IMU and speed
    what was captured `floor(ego_ms / 1000 / dt)` ticks ago. While an episode is shorter than the delay, its oldest
    capture is delivered. Every signal keeps the tick of its capture; ground truth is not delayed.

    Severities: milliseconds, 0 or more; `ego_ms` None means `camera_ms`. A delay above 0 must last at least one tick.

    Source: the released code's `SENSOR_DELAY_CAM` and `SENSOR_DELAY_EGO` (in ticks); one of the paper's figures names
    it, none of its results use it.

    >>> str(SensorDelay(camera_ms=100)), str(SensorDelay(camera_ms=100, ego_ms=0))
    ('100 ms sensor delay', '100 ms sensor delay (ego_ms=0)')
    """

    camera_ms: float = 100.0
    ego_ms: float | None = None

    phrase: ClassVar[str] = "{camera_ms} ms sensor delay"
    ladder: ClassVar = ("camera_ms", "ticks")

    def __post_init__(self) -> None:
        self.camera_ms = checked_number(self, "camera_ms", expected="milliseconds of at least 0")
        if self.ego_ms is not None:
            self.ego_ms = checked_number(
                self, "ego_ms", expected="milliseconds of at least 0, or None (as the cameras)"
            )

    def reset(self, context: EpisodeContext) -> None:
        """Forget all captures. Raises `PerturbationError` for a delay between 0 and one tick."""
        self._camera_ticks = delay_ticks(self, "camera_ms", self.camera_ms / 1000.0, context.dt_s)
        self._ego_ticks = self._camera_ticks
        if self.ego_ms is not None:
            self._ego_ticks = delay_ticks(self, "ego_ms", self.ego_ms / 1000.0, context.dt_s)
        self._captures: deque[Observation] = deque()  # oldest first
        self._spans = Spans(context.stream)

    def observe(self, observation: Observation) -> Observation:
        """Return the current tick with the signals of earlier ones."""
        now = observation.tick
        longest = max(self._camera_ticks, self._ego_ticks)
        if longest == 0:
            return observation
        self._captures.append(self._kept(observation))
        while len(self._captures) > 1 and self._captures[1].tick <= now - longest:
            self._captures.popleft()
        delayed = observation
        if self._camera_ticks:
            delayed = replace(delayed, cameras=self._captured(now - self._camera_ticks).cameras)
            self._spans.touch(now, observation.cameras)
        if self._ego_ticks:
            ego = self._captured(now - self._ego_ticks)
            delayed = replace(delayed, gps=ego.gps, compass=ego.compass, imu=ego.imu, speed=ego.speed)
            self._spans.touch(now, _EGO_SIGNALS)
        return delayed

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that there is no camera to delay, or how many ticks the delay is."""
        if self.camera_ms > 0.0 and self.ego_ms == 0.0 and not cameras:
            return NO_CAMERA
        longest_ms = max(self.camera_ms, self.ego_ms or 0.0)
        return f"a delay of {longest_ms:g} ms is {whole_ticks(longest_ms / 1000.0, dt_s)} ticks at {1.0 / dt_s:g} Hz"

    def _kept(self, observation: Observation) -> Observation:
        """Return the observation to deliver later: images are copied, because the simulator may reuse its pixels."""
        if self._camera_ticks == 0:
            return replace(observation, cameras={}, truth=None)
        own = {name: Image(image.pixels.copy(), image.tick).read_only() for name, image in observation.cameras.items()}
        return replace(observation, cameras=own, truth=None)

    def _captured(self, tick: int) -> Observation:
        """Return the newest capture at or before `tick`, or the oldest capture when there is none."""
        found = self._captures[0]
        for capture in self._captures:
            if capture.tick > tick:
                break
            found = capture
        return found
