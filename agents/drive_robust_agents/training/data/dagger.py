"""DAgger (Ross et al. 2011): the learner drives, and the expert labels the visited moments.

Agent and expert take turns of 1 to 3 s. The expert watches all the time, so that its memory is complete when a fork of
the expert drives on from each kept moment; this drive is the label.

With settings the learner drives under deployment failures and visits the states to which these lead. A sample holds the
true moment, except for the targets: the planners follow the perturbed positions. The training draws all other
perturbations of the inputs anew (`failures`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.weights import locate
from drive_robust_agents.training.candidates import WEIGHTS_SUFFIX, CandidateFactory, file_and_options
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.expert_episode import SHIPPED, TICK_CAP, ExpertEpisode, Teacher
from drive_robust_agents.training.data.rollouts import DAGGER, KEEP_TICKS, Sample, is_kept, sample_branch
from pytest_drive_robust import Agent, Setting
from pytest_drive_robust.domain.agent import is_privileged
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import RunningStack
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.contract import agent_act, agent_reset

__all__ = ["Mixture", "agent_of", "agent_turns", "drive_mixture", "weights_digest"]

_TURN_TICKS = (20, 60)
_STUCK_S = 15.0
"""Seconds of standing after which an episode ends, because a stuck learner shows nothing new."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """The drivers of a DAgger episode: an agent, by name, reference or weights file, and the expert.

    The expert drives a share `beta` of the time. `agent` is the learned agent that the data is for; its class reads the
    weights. Any other agent may drive, too. `settings` are sentences such as `"GPS noise 15 m"`: each episode draws one
    sentence for the agent; empty means clean. Options may follow a weights file, as in
    `"tcp.safetensors+tuning=published"`.
    """

    agent: str
    driver: str
    beta: float
    settings: tuple[str, ...] = ()

    def setting(self, rng: np.random.Generator) -> Setting:
        """Draw the setting of an episode. Raises `RequirementError` for a sentence that is none."""
        return Setting.parse(self.settings[rng.integers(len(self.settings))]) if self.settings else Setting.CLEAN


def agent_of(mixture: Mixture) -> Agent:
    """Return a new agent of the mixture. Raises `UsageError` when the agent does not load."""
    driver, options = file_and_options(mixture.driver)
    if driver.endswith(WEIGHTS_SUFFIX):
        file = Path(driver)
        if not file.is_file():
            raise UsageError(f"--dagger {mixture.driver}: there is no such weights file.")
        return CandidateFactory(mixture.agent, file, options)()
    return default_registry().agent(mixture.driver)


def weights_digest(mixture: Mixture) -> str | None:
    """Return the SHA-256 of the driving weights, or None for an agent by name.

    Neither path nor version identifies weights: a path may get another file, and a version may change while the content
    does not. Raises `UsageError` for a file without a manifest.
    """
    driver, _ = file_and_options(mixture.driver)
    return locate(mixture.agent, driver)[1].sha256 if driver.endswith(WEIGHTS_SUFFIX) else None


def agent_turns(rng: np.random.Generator, ticks: int, beta: float) -> NDArray[np.bool_]:
    """Return (ticks,) true where the agent drives; each turn of 1 to 3 s is the expert's with probability `beta`."""
    mine, at = np.zeros(ticks, dtype=bool), 0
    while at < ticks:
        last = at + int(rng.integers(_TURN_TICKS[0], _TURN_TICKS[1] + 1))
        mine[at:last] = rng.random() >= beta
        at = last
    return mine


def drive_mixture(
    route: Route, *, agent: Agent, mixture: Mixture, data_seed: int, seed: int, teacher: Teacher = SHIPPED
) -> list[Sample]:
    """Drive an episode and return its samples: kept moments up to the first fault, labelled by the expert.

    Moments from which even the expert cannot but break a rule are left out.
    """
    cameras = tuple(agent.sensors())
    episode = ExpertEpisode.begin(route, seed=seed, cameras=cameras, stuck_s=_STUCK_S, teacher=teacher)
    simulator = episode.simulator
    setting = mixture.setting(draws(data_seed, route.id, seed, "setting"))
    failures = RunningStack.of(setting, route_id=route.id, seed=seed, dt_s=simulator.dt_s, cameras=cameras)
    turns = agent_turns(draws(data_seed, route.id, seed, "turns"), TICK_CAP + 1, mixture.beta)
    rng = draws(data_seed, route.id, seed, "moments")
    phase, found = int(rng.integers(KEEP_TICKS)), list[Sample]()
    agent_reset(agent, simulator.plan(), seed)
    while not episode.over:
        tick, ego = simulator.state.tick, simulator.state.ego
        seen = failures.observe(simulator.observe())
        episode.told = seen.gps
        if tick % KEEP_TICKS == phase and is_kept(ego.speed_mps, rng):
            sample = sample_branch(episode, None, DAGGER)
            found += [sample] if sample is not None else []
        episode.targets()
        wanted, said = episode.act(), None
        if failures.wants_inference(tick):
            truth = simulator.truth().private() if is_privileged(agent) else None
            said = agent_act(agent, replace(seen.private(), truth=truth))
        late = failures.actuate(tick, said, 0.0)
        simulator.step(late if turns[tick] else wanted)
    return found
