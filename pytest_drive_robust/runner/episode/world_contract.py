"""Checks what a world answers, and the schedule of a stack: every fault becomes a `SimulationError` with one sentence.

A wrong answer that went on to the agent or into a record would be blamed on the agent, or on nobody.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.perturbations.stack import RunningStack
from pytest_drive_robust.simulators.base import EpisodeScore, Simulator
from pytest_drive_robust.store.episode_fields import unstorable

_ROUNDING_PCT = 1e-6
"""Tolerance in percent: the sum of the metres outside may exceed the driven distance in its last digits."""


def world_dt_s(world: Simulator) -> float:
    """Return the seconds of a tick, above 0."""
    if not 0.0 < world.dt_s < math.inf:
        raise SimulationError(f"dt_s is {world.dt_s!r}, expected the seconds of a tick, above 0")
    return world.dt_s


def world_reset(world: Simulator, route: Route, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
    """Begin an episode in the world; return its first state."""
    return _checked_state("reset", world.reset(route, seed=seed, cameras=cameras))


def world_step(world: Simulator, control: Control) -> WorldState:
    """Advance the world by one tick; return its state then."""
    return _checked_state("step", world.step(control))


def _checked_state(call: str, state: object) -> WorldState:
    if not isinstance(state, WorldState):
        raise SimulationError(f"{call}() gave {state!r}, expected a WorldState")
    return state


def world_observation(world: Simulator, mounted: Mapping[str, CameraSpec]) -> Observation:
    """Return the world's observation, with one image of each camera in `mounted`."""
    captured: object = world.observe()
    if not isinstance(captured, Observation):
        raise SimulationError(f"observe() gave {captured!r}, expected an Observation")
    problem = captured.signal_problem()
    if problem is not None:
        raise SimulationError(f"observe() gave an observation whose {problem}")
    if captured.cameras.keys() != mounted.keys():
        raise SimulationError(
            f"observe() gave images of {sorted(captured.cameras)}, expected those of {sorted(mounted)}"
        )
    for name, camera in mounted.items():
        problem = camera.image_problem(captured.cameras[name])
        if problem is not None:
            raise SimulationError(f"observe() gave an image of another kind: {problem}")
    return captured


def world_ends(world: Simulator) -> bool:
    """Return whether the world ends the episode."""
    done: object = world.done
    if done is None or isinstance(done, End):
        return done is not None
    raise SimulationError(f"done is {done!r}, expected an End, and None while the episode goes on")


def world_score(world: Simulator) -> EpisodeScore:
    """Return the world's score, which can be stored."""
    score: object = world.score()
    if not isinstance(score, EpisodeScore):
        raise SimulationError(f"score() gave {score!r}, expected an EpisodeScore")
    if not isinstance(score.end, End):
        raise SimulationError(f"score() gave the end {score.end!r}, expected an End")
    for item in score.infractions:
        if not isinstance(item, Infraction):
            raise SimulationError(f"score() gave the infraction {item!r}, expected Infraction objects")
    for field in fields(EpisodeScore):
        problem = unstorable(field.name, getattr(score, field.name))
        if problem is not None:
            raise SimulationError(f"score() gave what cannot be stored, {problem}")
    for item in score.infractions:
        if item.kind is InfractionKind.OUTSIDE_LANES and item.share_pct > 100.0 + _ROUNDING_PCT:
            raise SimulationError(f"score() gave {item.kind.value} with share_pct {item.share_pct!r}, expected 0..100")
    return score


def stack_schedule(stack: RunningStack) -> tuple[Injection, ...]:
    """Return what the perturbations injected, which can be stored."""
    schedule = stack.schedule()
    for item in schedule:
        if not isinstance(item, Injection):
            raise SimulationError(f"schedule() of a perturbation gave {item!r}, expected Injection objects")
    problem = unstorable("schedule", schedule)
    if problem is not None:
        raise SimulationError(f"schedule() of a perturbation gave what cannot be stored, {problem}")
    return schedule
