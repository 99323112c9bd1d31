"""Which frames a training sees, how often, and that a step's batch follows from the seed alone."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
import numpy as np
from frames_on_disk import write_frames
from hypothesis import given
from hypothesis import strategies as st
from tiny_tcp import CAMERAS

from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.frames import Frames
from drive_robust_agents.training.loop.feed import Feed
from drive_robust_agents.training.loop.sampling import bucket_weights, draw_epoch, level_types
from drive_robust_agents.training.loop.schedule import cycle, learning_rate, stage_at
from drive_robust_agents.training.recipes.recipe import RECIPES, Defaults, TrainingStage, recipe_of
from drive_robust_agents.training.recipes.tcp import TcpRecipe
from pytest_drive_robust.errors import UnknownNameError, UsageError


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return Frames(write_frames(tmp_path_factory.mktemp("frames"), rows=96, cameras=CAMERAS, episodes=8, shards=3))


class Remembers(TcpRecipe):
    """Also reads the frame of half a second before."""

    history = ("cam_front", "pose")

    def batch(self, arrays, generator, training):
        numbers = {name: arrays[name] for name in ("pose", "old_pose", "old_ok", "old_cam_front", "speed")}
        return {name: torch.from_numpy(value) for name, value in numbers.items()}

    needs = (*TcpRecipe.needs, "pose")


def test_what_is_rare_and_matters_is_seen_more_and_standing_less() -> None:
    still = np.zeros((6, 12, 4), np.float32)
    columns = {
        "speed": np.array([0.0, 0.0, 8.0, 8.0, 8.0, 8.0], np.float32),
        "future": still,
        "controls": np.zeros((6, 5, 3), np.float32),
        "command": np.full((6, 2), 4, np.int8),
        "tag": np.zeros(6, np.int16),
    }
    still[1:, -1, 0] = 20.0
    still[1, 7, 3] = 3.0  # starts
    columns["controls"][3, 1, 2] = 0.8  # brakes
    still[4, -1, 2] = 0.8  # turns
    columns["command"][5] = 5  # changes the lane
    assert bucket_weights(columns).tolist() == [0.4, 4.0, 1.0, 2.0, 2.0, 2.5]


@given(st.lists(st.integers(1, 400), min_size=2, max_size=44), st.integers(0, 99))
def test_no_scenario_type_falls_below_the_floor(counts: list[int], seed: int) -> None:
    tags = np.repeat(np.arange(len(counts)), counts)
    weights = np.random.Generator(np.random.Philox(seed)).uniform(0.4, 4.0, len(tags))
    leveled = level_types(weights, tags)
    shares = np.bincount(tags, weights=leveled)
    assert leveled.sum() == pytest.approx(1.0)
    assert shares.min() >= min(0.02, 0.9 / len(counts)) * (1.0 - 1e-9)
    for tag in range(len(counts)):  # within a type nothing changes
        mine = tags == tag
        assert np.allclose(leveled[mine] / leveled[mine].sum(), weights[mine] / weights[mine].sum())


def test_types_above_the_floor_keep_their_proportions() -> None:
    tags = np.repeat([0, 1, 2], [600, 399, 1])
    shares = np.bincount(tags, weights=level_types(np.ones(1000), tags))
    assert shares[2] == pytest.approx(0.02)
    assert shares[0] / shares[1] == pytest.approx(600 / 399)


@given(st.integers(2, 200), st.integers(0, 1000))
def test_a_pass_visits_each_row_as_often_as_its_weight_says(size: int, seed: int) -> None:
    weights = draws("weights", seed).uniform(0.1, 5.0, size)
    counts = np.bincount(draw_epoch(weights, draws("pass", seed)), minlength=size)
    wanted = size * weights / weights.sum()
    assert counts.sum() == size
    assert (np.abs(counts - wanted) < 1.0 + 1e-6).all()


def test_batches_follow_from_seed_and_step_whatever_came_before(frames: Frames) -> None:
    one, other = (Feed(frames, TcpRecipe(), batch=8, seed=3, threads=threads) for threads in (1, 3))
    whole = list(one.batches(0, 25))  # more than two passes
    late = list(other.batches(20, 25))
    assert len(whole) == 25
    for step, batch in enumerate(late, start=20):
        assert all(torch.equal(batch[name], whole[step][name]) for name in batch)
    assert not torch.equal(whole[0]["image"], next(Feed(frames, TcpRecipe(), batch=8, seed=4).batches(0, 1))["image"])


def test_no_episode_is_trained_on_and_validated_on(frames: Frames) -> None:
    feed, episodes = Feed(frames, TcpRecipe(), batch=8, seed=0), frames.column("episode")
    trained = {int(episodes[row]) for step in range(30) for row in feed.rows(step)}
    held = {int(episode) for episode in episodes[feed.validation]}
    assert held
    assert trained
    assert not trained & held


def test_validation_shows_images_as_they_are(frames: Frames) -> None:
    feed = Feed(frames, TcpRecipe(), batch=8, seed=0)
    images = torch.cat([batch["image"] for batch in feed.validating(1000)])
    assert np.array_equal(images.numpy(), frames.column("cam_front")[feed.validation])


def test_the_frame_half_a_second_before_comes_along_where_there_is_one(frames: Frames) -> None:
    feed = Feed(frames, Remembers(), batch=16, seed=0)
    rows, batch = feed.rows(0), feed.make(0)
    ticks, there = frames.column("tick")[rows], batch["old_ok"].numpy()
    assert np.array_equal(there, ticks >= 10)
    assert there.any()
    assert not there.all()
    assert (batch["old_cam_front"][~there] == 0).all()
    assert np.array_equal(batch["old_pose"].numpy()[there], frames.column("pose")[rows[there] - 2])


def test_too_few_frames_are_refused(frames: Frames) -> None:
    with pytest.raises(UsageError, match="do not fill a batch of 96: collect more"):
        Feed(frames, TcpRecipe(), batch=96, seed=0)


def test_the_learning_rate_rises_then_falls_in_every_stage() -> None:
    stages = (TrainingStage(0.25), TrainingStage(0.75, ("encoder",), 0.1))
    rates = [learning_rate(stages, step, 400, 1e-3) for step in range(400)]
    assert max(rates[:100]) == pytest.approx(1e-3, rel=1e-3)
    assert max(rates[100:]) == pytest.approx(1e-4, rel=1e-3)
    assert rates[99] < 1e-5
    assert rates[399] < 1e-6
    assert [stage_at(stages, step, 400)[0] for step in (0, 99, 100, 399)] == [0, 0, 1, 1]
    assert cycle(0.0) == pytest.approx(0.04)


def test_every_learned_agent_has_a_recipe() -> None:
    for name in RECIPES:
        recipe = recipe_of(name)
        assert recipe.name == name
        assert isinstance(recipe.defaults, Defaults)
        assert sum(stage.share for stage in recipe.stages) > 0.0
        assert {f"cam_{camera.name}" for camera in recipe.rig} <= set(recipe.needs)


def test_a_misspelt_agent_is_told_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'simlingo'"):
        recipe_of("simlinog")
