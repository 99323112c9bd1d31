"""Drives an episode exactly as a run does, and records a `Tape`: everything that a film needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from pytest_drive_robust.domain.agent import Agent, PlannedPath
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import EgoState, LaneMap, WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.jit.arrays import Floats, Pixels
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.simulators.base import Simulator

_VIEW = CameraSpec("front (not given to the agent)", width_px=384, height_px=216)
_WIDEST_PX = 640
_JPEG_QUALITY = 92


def main_camera(names: Iterable[str]) -> str:
    """Return the camera to show large: `front`, else the middle one. `names` must not be empty."""
    listed = list(names)
    return "front" if "front" in listed else listed[len(listed) // 2]


@dataclass(frozen=True, slots=True)
class Picture:
    """One camera image as a JPEG, at most 640 px wide; `tick` is the tick of its capture."""

    camera: str
    tick: int
    jpeg: bytes = field(repr=False)

    @classmethod
    def of(cls, camera: str, image: Image) -> Picture:
        """Return the compressed image of `camera`."""
        pixels = image.pixels[:, :, ::-1]
        height, width = pixels.shape[:2]
        if width > _WIDEST_PX:
            size = (_WIDEST_PX, max(1, round(height * _WIDEST_PX / width)))
            pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
        jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
        return cls(camera, image.tick, jpeg)

    def pixels(self) -> Pixels:
        """Return (height, width, 3) uint8 RGB."""
        decoded = np.asarray(cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)
        return np.ascontiguousarray(decoded[:, :, ::-1])


@dataclass(frozen=True, slots=True)
class TapedMoment:
    """The world at the beginning of a tick, and what the agent and the vehicle did in that tick.

    `pictures`, `gps` (x, y in metres) and `speed_mps` are what the agent was given. `real` is the picture of the main
    camera before the perturbations, None when they did not change it. `asked` is the agent's newest control, None
    before its first; `applied` is the control that the vehicle got. `plan` is the agent's newest plan, with points in
    world coordinates in metres. The last moment of a tape is the end of the episode, without `asked` and `applied`.
    """

    state: WorldState
    pictures: tuple[Picture, ...] = ()
    real: Picture | None = None
    gps: tuple[float, float] | None = None
    speed_mps: float | None = None
    asked: Control | None = None
    applied: Control | None = None
    plan: PlannedPath | None = None


@dataclass(frozen=True, slots=True)
class Tape:
    """One recorded episode: its result and `result.ticks + 1` moments, fewer when the world broke.

    `route` is (n, 4) as in `GroundTruth`. `shown_only` is True when the pictures were made for people, because the
    agent has no camera. `plan_problem` says why no plan is shown although the agent has one, else it is empty.
    """

    result: EpisodeResult
    moments: tuple[TapedMoment, ...]
    lane_map: LaneMap
    route: Floats
    shown_only: bool = False
    plan_problem: str = ""

    def images(self, position: int) -> dict[str, tuple[Pixels, int]]:
        """Return the pictures of a moment by camera, (height, width, 3) uint8 RGB, each with its tick of capture."""
        return {item.camera: (item.pixels(), item.tick) for item in self.moments[position].pictures}

    def real(self, position: int) -> Pixels | None:
        """Return the main camera's image before the perturbations, (height, width, 3) uint8 RGB; None if unchanged."""
        picture = self.moments[position].real
        return None if picture is None else picture.pixels()


def record_episode(
    simulator: Simulator,
    agent: Agent,
    *,
    route: Route,
    setting: Setting,
    seed: int,
    agent_name: str,
    ticked: Callable[[int], object] | None = None,
) -> Tape:
    """Drive one episode as a run does and return its tape; the trajectory is the same bit for bit.

    For an agent without a camera, a camera is mounted whose images only the film gets. `ticked(tick)` is called after
    every tick. Raises `SimulationError` when the world could not be built.
    """
    episode = Episode(agent_name, route.id, str(setting), seed)
    recording = _Recording(ticked or (lambda tick: None))
    running = RunningEpisode(simulator, agent, route, setting, seed, watch=recording, view=_VIEW)
    with borrowed_generators(repr(episode)):
        return recording.tape(running, episode)


def difference(driven: EpisodeResult, stored: EpisodeResult) -> str:
    """Return a clause that says where two drives of one episode first differ; `""` when they are the same bits."""
    if driven.trace.digest == stored.trace.digest:
        return ""
    shared = min(driven.ticks, stored.ticks)
    # as bits, as digests are made of: 0.0 is not -0.0
    one, other = (np.ascontiguousarray(result.trace.rows[:shared]).view(np.uint64) for result in (driven, stored))
    unequal = (one != other).any(axis=1)
    if bool(unequal.any()):
        return f"from {(int(np.argmax(unequal)) + 1) * driven.dt_s:.2f} s on"
    return f"only in length: {driven.game_s:.2f} s now, {stored.game_s:.2f} s stored"


class _Recording(Watch):
    """Records the moments of an episode while it is driven."""

    def __init__(self, told: Callable[[int], object]) -> None:
        self._told = told
        self._moments: list[TapedMoment] = []
        self._asked: Control | None = None
        self._planned: PlannedPath | None = None
        self._plan_problem = ""

    def tape(self, running: RunningEpisode, episode: Episode) -> Tape:
        """Drive to the end and return the tape. Raises `SimulationError` when the world could not be built."""
        self._running = running
        running.attempt(running.start)
        truth = None if running.state is None else running.attempt(running.simulator.truth)
        while not running.over:
            running.attempt(running.tick)
        result = running.result(episode)
        if running.state is None or truth is None:
            raise SimulationError(f"{result.episode} has nothing to show: {result.end_detail}")
        last = self._moments[-1] if self._moments else TapedMoment(running.state)
        last = replace(last, state=running.state, gps=None, speed_mps=None, asked=None, applied=None)
        moments = (*self._moments, last)
        return Tape(result, moments, truth.lane_map, truth.route, running.shows_view, self._plan_problem)

    def _look_at_plan(self, ego: EgoState) -> None:
        """Keep the plan that the agent made in this tick, in world coordinates by the ego's present pose."""
        plan: Any = getattr(self._running.agent, "plan", None)
        if callable(plan) and not self._plan_problem:
            try:
                self._planned = _in_world(plan(), ego)
            except (Exception, SystemExit) as error:  # a broken plan must not lose the film or the episode
                self._planned, self._plan_problem = None, blame("plan", error)

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        images = observation.cameras or self._running.images
        if asked is not None:
            self._asked = asked
            self._look_at_plan(state.ego)
        self._moments.append(
            TapedMoment(
                state=replace(state, actors=state.actors.copy(), lights=state.lights.copy()),
                pictures=tuple(Picture.of(name, image) for name, image in images.items()),
                real=self._unlike(observation.cameras),
                gps=(observation.gps.x_m, observation.gps.y_m),
                speed_mps=observation.speed.mps,
                asked=self._asked,
                applied=applied,
                plan=self._planned,
            )
        )
        self._told(tick)

    def _unlike(self, given: Mapping[str, Image]) -> Picture | None:
        """Return the picture of the main camera before the perturbations; None when they did not change it."""
        if not given:
            return None
        name = main_camera(given)
        real = self._running.images[name]
        if given[name].pixels is real.pixels or (given[name].pixels == real.pixels).all():
            return None
        return Picture.of(name, real)


def _in_world(plan: PlannedPath, ego: EgoState) -> PlannedPath:
    """Return the plan with points in world instead of ego coordinates. Raises `ValueError` for a point not finite."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)

    def turned(points: Iterable[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        pairs = [(float(forward), float(right)) for forward, right in points]
        if not all(math.isfinite(forward) and math.isfinite(right) for forward, right in pairs):
            raise ValueError("a point is not finite")
        return tuple((ego.x_m + c * f - s * r, ego.y_m + s * f + c * r) for f, r in pairs)

    return PlannedPath(turned(plan.path), turned(plan.target_points), turned(plan.speed_points))
