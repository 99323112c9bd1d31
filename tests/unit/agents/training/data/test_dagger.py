"""DAgger: the agent drives, the expert labels, and nothing is kept behind the first fault."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from training_drives import route_of

from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents.tcp import TCP
from drive_robust_agents.training.data.dagger import Mixture, agent_of, agent_turns, drive_mixture
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.expert_episode import ExpertEpisode
from drive_robust_agents.training.data.rollouts import DAGGER
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import UnknownNameError, UsageError

WAY = "ControlLoss"


class Floored:
    """Straight on at full throttle; remembers what it was shown."""

    def __init__(self) -> None:
        self.seen: list[Observation] = []

    def sensors(self) -> tuple[CameraSpec, ...]:
        return (CameraSpec("front", width_px=32, height_px=16),)

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.seen = []

    def act(self, observation: Observation) -> Control:
        self.seen.append(observation)
        return Control(1.0, 0.15, 0.0)


def mixture(beta: float, *settings: str) -> Mixture:
    return Mixture("tcp", "constant", beta, settings)


def test_a_faulty_agent_is_stopped_at_its_first_fault_and_labelled_by_the_expert() -> None:
    agent = Floored()
    samples = drive_mixture(route_of(WAY), agent=agent, mixture=mixture(0.0), data_seed=0, seed=0)
    episode = ExpertEpisode.begin(route_of(WAY), seed=0)
    while not episode.over:
        episode.simulator.step(Control(1.0, 0.15, 0.0))
    fault = episode.simulator.state.tick
    assert len(agent.seen) == fault
    assert samples
    assert all(sample.source == DAGGER and sample.tick < fault for sample in samples)
    late = samples[-1]
    assert late.controls[0].throttle < 1.0  # the expert does something else


def test_the_agent_sees_its_own_cameras_and_no_truth() -> None:
    agent = Floored()
    drive_mixture(route_of(WAY), agent=agent, mixture=mixture(0.0), data_seed=0, seed=0)
    assert all(observation.truth is None for observation in agent.seen)
    assert agent.seen[0].cameras["front"].pixels.shape == (16, 32, 3)
    assert [observation.tick for observation in agent.seen] == list(range(len(agent.seen)))


def test_with_the_expert_alone_the_labels_are_its_own_drive() -> None:
    samples = drive_mixture(route_of(WAY), agent=Floored(), mixture=mixture(1.0), data_seed=0, seed=0)
    places = {state.tick: state.ego for sample in samples for state in sample.states}
    assert len(samples) > 30
    for before, after in pairwise(samples):
        assert before.states[0].ego == places[before.tick]
        step = after.tick - before.tick
        if step < len(before.states):
            assert before.states[step].ego == after.states[0].ego


def test_under_a_failure_the_agent_is_told_what_is_wrong_and_the_planners_follow_it() -> None:
    agent, told = Floored(), Floored()
    clean = drive_mixture(route_of(WAY), agent=agent, mixture=mixture(1.0), data_seed=0, seed=0)
    wrong = drive_mixture(route_of(WAY), agent=told, mixture=mixture(1.0, "GPS noise 15 m"), data_seed=0, seed=0)
    off = [
        math.dist((a.gps.x_m, a.gps.y_m), (b.gps.x_m, b.gps.y_m)) for a, b in zip(agent.seen, told.seen, strict=True)
    ]
    assert 10.0 < np.mean(off) < 30.0
    assert [one.tick for one in wrong] == [one.tick for one in clean]
    assert all(one.states[0].ego == other.states[0].ego for one, other in zip(wrong, clean, strict=True))
    assert any(one.here.targets != other.here.targets for one, other in zip(wrong, clean, strict=True))


def test_late_controls_lead_the_agent_elsewhere_but_not_the_expert() -> None:
    def drives(beta: float, *settings: str) -> list[WorldState]:
        found = drive_mixture(route_of(WAY), agent=Floored(), mixture=mixture(beta, *settings), data_seed=0, seed=0)
        return [one.states[0] for one in found]

    assert drives(1.0, "500 ms latency")[-1].ego == drives(1.0)[-1].ego
    late, clean = drives(0.0, "500 ms latency"), drives(0.0)
    moved = [next(state.tick for state in of if state.ego.speed_mps > 1.0) for of in (late, clean)]
    assert moved[0] > moved[1]


def test_each_episode_draws_one_of_the_settings() -> None:
    three = mixture(0.5, "clean", "GPS noise 15 m", "occlusion 0.8")
    drawn = Counter(str(three.setting(draws(0, k))) for k in range(300))
    assert set(drawn) == set(three.settings)
    assert min(drawn.values()) > 70


def test_turns_last_one_to_three_seconds_and_share_the_time() -> None:
    for beta in (0.0, 0.5, 1.0):
        mine = np.concatenate([agent_turns(draws("turns", k), 4000, beta) for k in range(10)])
        assert mine.mean() == pytest.approx(1.0 - beta, abs=0.06)
    one = agent_turns(draws("turns"), 4000, 0.5).astype(int)
    lengths = np.diff(np.flatnonzero(np.diff(one)))
    assert lengths.min() >= 20


def test_agents_come_by_name_by_reference_and_by_their_weights(tmp_path: Path) -> None:
    assert type(agent_of(mixture(0.5))).__name__ == "Constant"
    assert type(agent_of(Mixture("tcp", "drive_robust_agents.reactive:Reactive", 0.5))).__name__ == "Reactive"
    with pytest.raises(UnknownNameError, match="Did you mean 'reactive'"):
        agent_of(Mixture("tcp", "reactiv", 0.5))
    with pytest.raises(UsageError, match="there is no such weights file"):
        agent_of(Mixture("tcp", str(tmp_path / "none.safetensors"), 0.5))


def test_options_of_the_agent_stand_behind_its_weights() -> None:
    agent = agent_of(Mixture("tcp", f"{SHIPPED / 'tcp.safetensors'}+tuning=published", 0.5))
    assert isinstance(agent, TCP)
    assert agent.tuning == "published"
    with pytest.raises(UsageError, match="Did you mean 'tuning'"):
        agent_of(Mixture("tcp", f"{SHIPPED / 'tcp.safetensors'}+tunin=published", 0.5))
