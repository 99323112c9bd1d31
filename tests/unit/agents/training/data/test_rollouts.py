"""Samples: branches leave no trace, labels are what the expert really does, nothing is kept around a fault."""

from __future__ import annotations

import math

import numpy as np
import pytest
from training_drives import data_seed, route_of, samples_of

from drive_robust_agents.expert import Expert
from drive_robust_agents.training.data import expert_episode
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.expert_episode import ExpertEpisode, faults
from drive_robust_agents.training.data.labels import BRANCH_TICKS
from drive_robust_agents.training.data.noise import burst_plan
from drive_robust_agents.training.data.poses import Pose
from drive_robust_agents.training.data.rollouts import ON_WAY, SHIFTED, START, drive_expert, sample_branch
from pytest_drive_robust import Control, Observation
from pytest_drive_robust.domain.truth import WorldState

WAY = "ControlLoss"


def same(one: WorldState, other: WorldState) -> bool:
    """To the last bit."""
    arrays = np.array_equal(one.actors, other.actors) and np.array_equal(one.lights, other.lights)
    return one.tick == other.tick and one.ego == other.ego and arrays


def drive(*, branches: bool) -> ExpertEpisode:
    """The expert's own drive, with a branch and a shifted branch off now and then, or without."""
    episode = ExpertEpisode.begin(route_of(WAY), seed=0)
    while not episode.over:
        tick, ego = episode.simulator.state.tick, episode.simulator.state.ego
        if branches and tick % 25 == 0:
            sample_branch(episode, None, ON_WAY)
            aside = Pose(ego.x_m - math.sin(ego.yaw_rad), ego.y_m + math.cos(ego.yaw_rad), ego.yaw_rad + 0.1, 3.0)
            sample_branch(episode, aside, SHIFTED)
        episode.targets()
        control = episode.act()
        episode.step(control, control)
    return episode


@pytest.fixture(scope="module")
def plain() -> ExpertEpisode:
    return drive(branches=False)


def test_branches_change_nothing_about_the_drive(plain: ExpertEpisode) -> None:
    branched = drive(branches=True)
    assert branched.controls == plain.controls
    assert all(same(a, b) for a, b in zip(branched.states, plain.states, strict=True))
    assert [planner.dropped for planner in branched.planners] == [planner.dropped for planner in plain.planners]


def test_a_branch_without_a_shift_is_what_really_happens(plain: ExpertEpisode) -> None:
    episode = ExpertEpisode.begin(route_of(WAY), seed=0)
    for tick, control in enumerate(plain.controls[:-BRANCH_TICKS]):
        if tick % 40 == 7:
            sample = sample_branch(episode, None, ON_WAY)
            assert sample is not None
            assert list(sample.controls) == plain.controls[tick : tick + BRANCH_TICKS]
            driven = plain.states[tick : tick + BRANCH_TICKS + 1]
            assert all(same(a, b) for a, b in zip(sample.states, driven, strict=True))
        assert episode.act() == control
        episode.step(control, control)


def test_on_the_way_the_future_of_a_sample_is_what_was_driven(plain: ExpertEpisode) -> None:
    kept = [sample for sample in samples_of(WAY) if sample.source == ON_WAY]
    assert len(kept) > 20
    for sample in kept:
        driven = [*plain.states, plain.simulator.state][sample.tick : sample.tick + BRANCH_TICKS + 1]
        assert all(same(a, b) for a, b in zip(sample.states, driven, strict=True))


def test_the_same_names_give_the_same_samples() -> None:
    route, again = route_of(WAY), samples_of(WAY)
    once_more = drive_expert(route, data_seed=data_seed(route, noisy=False), seed=0)
    assert [(s.tick, s.source) for s in once_more] == [(s.tick, s.source) for s in again]
    assert all(same(a.states[-1], b.states[-1]) for a, b in zip(once_more, again, strict=True))


def test_the_label_of_a_noisy_moment_is_an_expert_without_noise() -> None:
    route = route_of(WAY)
    seed = data_seed(route, noisy=True)
    noise = burst_plan(draws(seed, route.id, 0, "noise"), 400)
    start = int(np.flatnonzero(noise)[0])
    episode = ExpertEpisode.begin(route, seed=0)
    while episode.simulator.state.tick < start:
        control = episode.act()
        episode.step(control, control)
    clean = sample_branch(episode, None, ON_WAY)
    assert clean is not None
    samples = [s for s in samples_of(WAY, noisy=True) if s.source == ON_WAY and start - 10 < s.tick <= start]
    assert samples
    for sample in samples:  # before the first burst the drive is the clean one, so is its future in the label
        assert same(sample.states[start - sample.tick], clean.states[0])
        assert same(sample.states[start - sample.tick + 40], clean.states[40])


def test_samples_come_in_the_order_of_time_and_only_shifted_ones_share_a_moment() -> None:
    samples = samples_of(WAY)
    assert [s.tick for s in samples] == sorted(s.tick for s in samples)
    on_way = [s.tick for s in samples if s.source == ON_WAY]
    assert len(set(on_way)) == len(on_way)
    assert {s.tick % 5 for s in samples} == {samples[0].tick % 5}


def test_shifted_samples_begin_beside_the_way_and_the_expert_comes_back() -> None:
    samples = samples_of(WAY)
    way = {s.tick: s.here.ego for s in samples if s.source == ON_WAY}
    shifted = [s for s in samples if s.source == SHIFTED and s.tick in way]
    assert len(shifted) > 0.7 * len(way)
    starts = [s for s in samples if s.source == START]
    assert all(s.here.ego.speed_mps == 0.0 and s.states[-1].ego.speed_mps > 1.0 for s in starts)
    for s in shifted:
        there, here = way[s.tick], s.here.ego
        aside = math.hypot(here.x_m - there.x_m, here.y_m - there.y_m)
        assert 0.3 - 1e-9 <= aside <= 1.5 + 1e-9
        assert abs(math.remainder(here.yaw_rad - there.yaw_rad, math.tau)) <= math.radians(15.0) + 1e-9


# --- faults ---


class Reckless(Expert):
    """Drives as the expert for five seconds, then straight on at full throttle."""

    def act(self, observation: Observation) -> Control:
        control = super().act(observation)
        return control if observation.tick < 100 else Control(1.0, 0.3, 0.0)


def test_no_frame_is_kept_whose_future_holds_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expert_episode, "Expert", Reckless)
    episode = ExpertEpisode.begin(route_of(WAY), seed=0)
    while not episode.over:
        control = episode.act()
        episode.step(control, control)
    fault = episode.simulator.state.tick
    assert faults(episode.simulator) == 1 or episode.simulator.world.state.criteria[0] > 0.0
    samples = drive_expert(route_of(WAY), data_seed=data_seed(route_of(WAY), noisy=False), seed=0)
    assert samples
    assert max(sample.tick for sample in samples) < fault - BRANCH_TICKS


def test_a_branch_that_ends_in_a_collision_is_no_sample() -> None:
    episode = ExpertEpisode.begin(route_of("ParkedObstacle"), seed=0)
    for _ in range(40):
        control = episode.act()
        episode.step(control, control)
    body = episode.simulator.state.actors[0]
    inside = Pose(float(body[WorldState.X]) - 3.0, float(body[WorldState.Y]), 0.0, 15.0)
    before = episode.simulator.state
    assert sample_branch(episode, inside, SHIFTED) is None
    assert same(episode.simulator.state, before)
