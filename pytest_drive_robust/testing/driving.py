"""How the contract checks drive: whole episodes, recorded observations fed again, and digests to compare them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.contract import agent_act, agent_reset
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.testing.agents import RecordingAgent


def drive(
    agent: Agent, simulator: Simulator, *, route: Route, seed: int, setting: Setting | None = None
) -> tuple[RecordingAgent, EpisodeResult]:
    """Drive one whole episode; return the recording and the result. `setting` defaults to clean."""
    recorder = RecordingAgent(agent)
    result = drive_episode(
        simulator, recorder, route=route, setting=setting or Setting.CLEAN, seed=seed, agent_name="under test"
    )
    return recorder, result


def feed(
    agent: Agent,
    observations: Iterable[Observation],
    *,
    plan: GlobalPlan,
    seed: int,
    change: Callable[[Observation], Observation] = lambda observation: observation,
    after_act: Callable[[Agent], object] = lambda agent: None,
) -> list[Control]:
    """Return the controls of `agent` for observations of another episode, each changed by `change`.

    `after_act` is called after every control. Raises `AgentError` when the agent breaks its contract.
    """
    agent_reset(agent, plan, seed)
    controls = []
    for observation in observations:
        controls.append(agent_act(agent, change(observation.private())))
        after_act(agent)
    return controls


def first_difference(one: Sequence[object], other: Sequence[object]) -> int | None:
    """Return the first index at which two sequences differ, or None when they are equal."""
    for index, (left, right) in enumerate(zip(one, other, strict=False)):
        if left != right:
            return index
    return None if len(one) == len(other) else min(len(one), len(other))


def first_difference_seen(one: Iterable[Observation], other: Iterable[Observation]) -> int | None:
    """Return the first index at which the observations of two drives differ, or None when all are equal."""
    return first_difference([*map(observation_digest, one)], [*map(observation_digest, other)])


def observation_digest(observation: Observation) -> str:
    """Return a hex digest of everything in an observation but its truth: equal digests, equal observations."""
    digest = hashlib.blake2b(digest_size=16)
    signals = (observation.tick, observation.gps, observation.compass, observation.imu, observation.speed)
    digest.update(repr(signals).encode())
    for name, image in sorted(observation.cameras.items()):
        digest.update(repr((name, image.tick, image.pixels.shape, image.pixels.dtype.str)).encode())
        digest.update(image.pixels.tobytes())
    return digest.hexdigest()
