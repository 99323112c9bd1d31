"""Drives an episode exactly as the loop does, and keeps what a film of it needs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.agent import PlannedPath, is_privileged
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.generators import borrowed_for
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.replay.tape import Picture, PictureFile, Tape, TapeTick, main_camera

if TYPE_CHECKING:
    from collections.abc import Callable

    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Image, Observation
    from pytest_drive_robust.domain.outcome import End
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import GlobalPlan, Route
    from pytest_drive_robust.domain.truth import EgoState, GroundTruth, WorldState
    from pytest_drive_robust.perturbations.base import Setting
    from pytest_drive_robust.simulators.base import EpisodeScore, Simulator

__all__ = ["difference", "record_episode"]

_VIEW = CameraSpec("front (not given to the agent)", width_px=384, height_px=216)


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
    """Drive one episode as a run does and record it; the trajectory is the same bit for bit.

    Where the agent has no camera, one is mounted whose images only the film gets. `ticked(tick)` is called after every
    tick. Raises `SimulationError` when not even the world could be built.
    """
    world = _WatchedSimulator(simulator)
    driver = _WatchedAgent(agent, world)
    file = PictureFile()
    moments: list[TapeTick] = []

    def keep(tick: int, state: WorldState, observation: Observation, applied: Control) -> None:
        images = observation.cameras or world.view
        moments.append(
            TapeTick(
                state=replace(state, actors=state.actors.copy(), lights=state.lights.copy()),
                pictures=file.add(images),
                real=world.unlike(observation, file),
                gps=(observation.gps.x_m, observation.gps.y_m),
                speed_mps=observation.speed.mps,
                asked=driver.asked,
                applied=applied,
                plan=driver.planned,
            )
        )
        if ticked is not None:
            ticked(tick)

    try:
        with borrowed_for(Episode(agent_name, route.id, str(setting), seed)):
            result = drive_episode(
                world, driver, route=route, setting=setting, seed=seed, agent_name=agent_name, on_tick=keep
            )
        if world.state is None or world.start is None:
            raise SimulationError(f"{result.episode} has nothing to show: {result.end_detail}")
    except BaseException:
        file.close()
        raise
    last = moments[-1] if moments else TapeTick(world.state)
    moments.append(replace(last, state=world.state, gps=None, speed_mps=None, asked=None, applied=None))
    truth = world.start
    return Tape(result, tuple(moments), truth.lane_map, truth.route, file, world.has_view, driver.plan_problem)


def difference(driven: EpisodeResult, stored: EpisodeResult) -> str:
    """Return a clause on where two drives of one episode differ first; empty when they are the same bits."""
    import numpy as np

    if driven.trace.digest == stored.trace.digest:
        return ""
    shared = min(driven.ticks, stored.ticks)
    unequal = (driven.trace.rows[:shared] != stored.trace.rows[:shared]).any(axis=1)
    if bool(unequal.any()):
        return f"from {(int(np.argmax(unequal)) + 1) * driven.dt_s:.2f} s on"
    return f"only in length: {driven.game_s:.2f} s now, {stored.game_s:.2f} s stored"


class _WatchedSimulator:
    """The simulator, with an eye on its last state and images, and a camera for people where the agent has none."""

    def __init__(self, inner: Simulator) -> None:
        self._inner = inner
        self.name, self.version, self.dt_s = inner.name, inner.version, inner.dt_s
        self.state: WorldState | None = None
        self.start: GroundTruth | None = None
        self.view: Mapping[str, Image] = {}
        self.has_view = False

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        self.has_view = not cameras
        self.state = self._inner.reset(route, seed=seed, cameras=cameras or (_VIEW,))
        self.start = self._inner.truth()
        return self.state

    def plan(self) -> GlobalPlan:
        return self._inner.plan()

    def observe(self) -> Observation:
        observation = self._inner.observe()
        self.view = observation.cameras
        return replace(observation, cameras={}) if self.has_view else observation

    def unlike(self, given: Observation, file: PictureFile) -> Picture | None:
        """Return what the main camera showed, kept in `file`, where the perturbations made something else of it."""
        if not given.cameras:
            return None
        name = main_camera(given.cameras)
        real = self.view[name].pixels
        if given.cameras[name].pixels is real or (given.cameras[name].pixels == real).all():
            return None
        return file.add({name: self.view[name]})[0]

    def truth(self) -> GroundTruth:
        return self._inner.truth()

    def step(self, control: Control) -> WorldState:
        self.state = self._inner.step(control)
        return self.state

    @property
    def done(self) -> End | None:
        return self._inner.done

    @property
    def progress_m(self) -> float:
        return self._inner.progress_m

    def score(self) -> EpisodeScore:
        return self._inner.score()

    def versions(self) -> Mapping[str, str]:
        return self._inner.versions()

    def close(self) -> None:
        self._inner.close()


class _WatchedAgent:
    """The agent, with an eye on what it asked for and on its plan."""

    def __init__(self, inner: Agent, world: _WatchedSimulator) -> None:
        self._inner = inner
        self._world = world
        self.privileged = is_privileged(inner)
        self.asked: Control | None = None
        self.planned: PlannedPath | None = None
        self.plan_problem = ""

    def sensors(self) -> Sequence[CameraSpec]:
        return self._inner.sensors()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self._inner.reset(route, seed)

    def act(self, observation: Observation) -> Control:
        control = self._inner.act(observation)
        self.asked = control
        plan: Any = getattr(self._inner, "plan", None)
        if callable(plan) and self._world.state is not None and not self.plan_problem:
            try:
                self.planned = _in_world(plan(), self._world.state.ego)
            except Exception as error:  # a broken overlay is no reason to lose the film, nor the episode
                self.planned, self.plan_problem = None, blame("plan", error)
        return control


def _in_world(plan: PlannedPath, ego: EgoState) -> PlannedPath:
    """Return the plan with its points in the world instead of the ego's frame. Raises `ValueError` for a bad one."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)

    def turned(points: Iterable[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        pairs = [(float(forward), float(right)) for forward, right in points]
        if not all(math.isfinite(forward) and math.isfinite(right) for forward, right in pairs):
            raise ValueError("a point is not finite")
        return tuple((ego.x_m + c * f - s * r, ego.y_m + s * f + c * r) for f, r in pairs)

    return PlannedPath(turned(plan.path), turned(plan.target_points), turned(plan.speed_points))
