"""Drives an episode exactly as the loop does, and keeps what a film of it needs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.agent import PlannedPath
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.generators import borrowed_for
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.replay.tape import Picture, Tape, TapeTick, main_camera

if TYPE_CHECKING:
    from collections.abc import Callable

    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Image, Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.domain.truth import EgoState, WorldState
    from pytest_drive_robust.perturbations.base import Setting
    from pytest_drive_robust.simulators.base import Simulator

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
    episode = Episode(agent_name, route.id, str(setting), seed)
    recording = _Recording(RunningEpisode(simulator, agent, route, setting, seed, view=_VIEW))
    with borrowed_for(episode):
        return recording.tape(episode, ticked or (lambda tick: None))


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


class _Recording:
    """The moments of an episode that it drives."""

    def __init__(self, running: RunningEpisode) -> None:
        self._running = running
        self._moments: list[TapeTick] = []
        self._planned: PlannedPath | None = None
        self._plan_problem = ""

    def tape(self, episode: Episode, ticked: Callable[[int], object]) -> Tape:
        """Drive to the end. Raises `SimulationError` when not even the world could be built."""
        running = self._running
        running.attempt(running.start)
        truth = None if running.state is None else running.attempt(running.simulator.truth)
        while not running.over:
            running.attempt(running.tick)
            if running.last_tick is not None:
                self._keep(*running.last_tick)
                ticked(running.last_tick[0])
        result = running.result(episode)
        if running.state is None or truth is None:
            raise SimulationError(f"{result.episode} has nothing to show: {result.end_detail}")
        last = self._moments[-1] if self._moments else TapeTick(running.state)
        last = replace(last, state=running.state, gps=None, speed_mps=None, asked=None, applied=None)
        moments = (*self._moments, last)
        return Tape(result, moments, truth.lane_map, truth.route, running.shows_view, self._plan_problem)

    def _look_at_plan(self, ego: EgoState) -> None:
        """Keep the plan that the agent made in this tick, where the ego was then."""
        plan: Any = getattr(self._running.agent, "plan", None)
        if callable(plan) and not self._plan_problem:
            try:
                self._planned = _in_world(plan(), ego)
            except (Exception, SystemExit) as error:  # a broken overlay is no reason to lose the film, nor the episode
                self._planned, self._plan_problem = None, blame("plan", error)

    def _keep(self, tick: int, state: WorldState, observation: Observation, applied: Control) -> None:
        images = observation.cameras or self._running.images
        asked_tick, asked = self._running.asked or (None, None)
        if asked_tick == tick:
            self._look_at_plan(state.ego)
        self._moments.append(
            TapeTick(
                state=replace(state, actors=state.actors.copy(), lights=state.lights.copy()),
                pictures=tuple(Picture.of(name, image) for name, image in images.items()),
                real=self._unlike(observation.cameras),
                gps=(observation.gps.x_m, observation.gps.y_m),
                speed_mps=observation.speed.mps,
                asked=asked,
                applied=applied,
                plan=self._planned,
            )
        )

    def _unlike(self, given: Mapping[str, Image]) -> Picture | None:
        """Return what the main camera showed where the perturbations made something else of it."""
        if not given:
            return None
        name = main_camera(given)
        real = self._running.images[name]
        if given[name].pixels is real.pixels or (given[name].pixels == real.pixels).all():
            return None
        return Picture.of(name, real)


def _in_world(plan: PlannedPath, ego: EgoState) -> PlannedPath:
    """Return the plan with its points in the world instead of the ego's frame. Raises `ValueError` for a bad one."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)

    def turned(points: Iterable[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        pairs = [(float(forward), float(right)) for forward, right in points]
        if not all(math.isfinite(forward) and math.isfinite(right) for forward, right in pairs):
            raise ValueError("a point is not finite")
        return tuple((ego.x_m + c * f - s * r, ego.y_m + s * f + c * r) for f, r in pairs)

    return PlannedPath(turned(plan.path), turned(plan.target_points), turned(plan.speed_points))
