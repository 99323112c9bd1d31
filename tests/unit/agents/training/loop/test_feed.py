"""The batch of a step follows from the seed alone, and nothing is both trained on and validated on."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
import numpy as np
from frames_on_disk import write_frames
from tiny_tcp import CAMERAS

from drive_robust_agents.tcp import joined
from drive_robust_agents.training.data.frames import Frames
from drive_robust_agents.training.loop.feed import Feed
from drive_robust_agents.training.recipes.tcp import TcpRecipe
from pytest_drive_robust.errors import UsageError


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
    pictures = [frames.column(f"cam_{name}")[feed.validation] for name in CAMERAS]
    assert np.array_equal(images.numpy(), joined(pictures))


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
