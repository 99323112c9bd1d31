"""Drive the expert and branch off its drives: every sample is a moment with the expert's drive from there.

A branch leaves no trace in the episode: a fork of the expert drives the branch, and the world is restored afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drive_robust_agents._vehicle.mkz import TICK_S
from drive_robust_agents.expert import Expert
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.expert_episode import (
    SHIPPED,
    STUCK_S,
    TICK_CAP,
    ExpertEpisode,
    Teacher,
    faults,
    seen_by_expert,
)
from drive_robust_agents.training.data.labels import BRANCH_TICKS, ExpertMoment
from drive_robust_agents.training.data.noise import burst_plan, burst_steer
from drive_robust_agents.training.data.poses import Pose, draw_pose
from pytest_drive_robust import Control
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import WorldState

__all__ = [
    "DAGGER", "KEEP_TICKS", "ON_WAY", "SHIFTED", "START", "Sample", "branch", "drive_expert", "is_kept",
    "sample_branch",
]  # fmt: skip

ON_WAY, SHIFTED, START, DAGGER = range(4)
"""Values of the column `source`."""
KEEP_TICKS = 5
_STANDING_MPS, _STANDING_SHARE = 0.1, 0.4
"""Speed below which the ego stands, and the share of such moments that is kept."""
_TRIES = 3
_MOVES_MPS = 1.0


@dataclass(frozen=True, slots=True)
class Sample:
    """A moment and the drive that begins with it: `states`, one per tick, and the expert's `controls`."""

    here: ExpertMoment
    states: Sequence[WorldState]
    controls: Sequence[Control]
    source: int
    tick: int


def is_kept(speed_mps: float, rng: np.random.Generator) -> bool:
    """Return whether a moment is kept; only a share of the moments with a standing ego is."""
    return speed_mps >= _STANDING_MPS or bool(rng.random() < _STANDING_SHARE)


def branch(episode: ExpertEpisode, expert: Expert) -> tuple[ExpertMoment, list[WorldState], list[Control]] | None:
    """Let `expert` (a fork) drive on for 3 s from the present world; return (moment, states per tick, controls).

    The drive ends early with the episode. Returns None after a collision or a broken rule. Neither the planners nor the
    world are restored.
    """
    simulator = episode.simulator
    before, targets = faults(simulator, lanes=False), episode.targets()
    states, controls, here = [simulator.state], [], None
    while len(states) <= BRANCH_TICKS and simulator.done is None:
        control = expert.act(seen_by_expert(simulator))
        here = here or ExpertMoment(simulator.truth(), expert.intent(), targets, episode.night)
        states.append(simulator.step(control))
        controls.append(control)
        if faults(simulator, lanes=False) > before or simulator.done is End.DEVIATED:
            return None
    return None if here is None else (here, states, controls)


def sample_branch(episode: ExpertEpisode, pose: Pose | None, source: int) -> Sample | None:
    """Return the sample of a branch from a pose (None: from where the ego is); the episode is as before afterwards."""
    simulator, kept = episode.simulator, episode.simulator.snapshot()
    dropped = [planner.dropped for planner in episode.planners]
    tick = simulator.state.tick
    if pose is not None:
        simulator.place_ego(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad, speed_mps=pose.speed_mps)
    found = branch(episode, episode.expert.fork())
    simulator.restore(kept)
    for planner, count in zip(episode.planners, dropped, strict=True):
        planner.dropped = count
    if found is None:
        return None
    here, states, controls = found
    started = pose is not None and pose.start and states[-1].ego.speed_mps > _MOVES_MPS
    return Sample(here, states, controls, START if started else source, tick)


def _shifted(episode: ExpertEpisode, rng: np.random.Generator) -> Sample | None:
    """Return a sample from a pose beside the way, or None where three draws found no room or no good end."""
    state = episode.simulator.state
    for _ in range(_TRIES):
        pose = draw_pose(state.ego, rng)
        if episode.room.is_free(state, pose):
            found = sample_branch(episode, pose, SHIFTED)
            if found is not None:
                return found
    return None


def drive_expert(route: Route, *, data_seed: int, seed: int, teacher: Teacher = SHIPPED) -> list[Sample]:
    """Return the samples of an episode of the expert in order of time, without samples that lead to a fault.

    `data_seed` names the draws of noise, moments and poses; `seed` is the episode's own.
    """
    episode = ExpertEpisode.begin(route, seed=seed, teacher=teacher)
    noise = burst_plan(draws(data_seed, route.id, seed, "noise"), TICK_CAP + BRANCH_TICKS)
    rng = draws(data_seed, route.id, seed, "moments")
    phase = int(rng.integers(KEEP_TICKS))
    beside: list[Sample] = []
    on_way: list[ExpertMoment] = []
    while not episode.over:
        tick, ego = episode.simulator.state.tick, episode.simulator.state.ego
        keep = tick % KEEP_TICKS == phase and is_kept(ego.speed_mps, rng)
        clean = not noise[tick : tick + BRANCH_TICKS].any()
        if keep:
            more = _shifted(episode, rng)
            beside += [more] if more is not None else []
            if not clean:
                more = sample_branch(episode, None, ON_WAY)
                beside += [more] if more is not None else []
        targets = episode.targets()
        control = episode.act()
        if keep and clean:
            on_way.append(episode.here(targets))
        steer = float(np.clip(control.steer + burst_steer(noise[tick], ego.speed_mps), -1.0, 1.0))
        episode.step(control, Control(control.throttle, steer, control.brake))
    episode.states.append(episode.simulator.state)
    first = episode.states[0].tick
    own_way = [_on_way(episode, here, here.truth.state.tick - first) for here in on_way]
    last = _last_good_tick(episode)
    return sorted((one for one in (*own_way, *beside) if one.tick <= last), key=lambda one: (one.tick, one.source))


def _on_way(episode: ExpertEpisode, here: ExpertMoment, at: int) -> Sample:
    """Return the sample whose future is the driven episode itself."""
    states, controls = episode.states[at : at + BRANCH_TICKS + 1], episode.controls[at : at + BRANCH_TICKS]
    return Sample(here, states, controls, ON_WAY, here.truth.state.tick)


def _last_good_tick(episode: ExpertEpisode) -> int:
    """Return the last tick whose next 3 s hold no fault."""
    tick = episode.simulator.state.tick
    if faults(episode.simulator) == 0 and episode.simulator.done is End.COMPLETED:
        return tick
    stood = round(STUCK_S / TICK_S) if episode.simulator.done in (End.STUCK, End.BLOCKED) else 0
    return tick - stood - BRANCH_TICKS - 1
