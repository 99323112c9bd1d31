"""The data set on disk: shards as one table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drive_robust_agents.training.data.frames import Frames, read_done, write_shard
from pytest_drive_robust.errors import UnknownNameError, UsageError


def row(number: int, episode: int) -> dict[str, np.ndarray]:
    return {
        "speed": np.float32(number),
        "path": np.full((24, 2), number, np.float32),
        "episode": np.int32(episode),
        "source": np.int8(number % 3),
    }


def fill(folder: Path, *sizes: int, first: int = 0) -> None:
    """Shards of so many rows, two rows an episode."""
    number = first
    for k, size in enumerate(sizes):
        some = [row(number + j, (number + j) // 2) for j in range(size)]
        write_shard(folder, k, some, {"routes": [f"1-{k}"], "seed": 0})
        number += size


def test_shards_are_one_table(tmp_path: Path) -> None:
    fill(tmp_path, 4, 0, 6)
    frames = Frames(tmp_path)
    assert len(frames) == 10
    assert frames.names == ("episode", "path", "source", "speed")
    assert frames.column("speed").tolist() == [float(k) for k in range(10)]


def test_rows_come_in_any_order_and_as_often_as_asked_for(tmp_path: Path) -> None:
    fill(tmp_path, 4, 6)
    found = Frames(tmp_path).arrays(("path", "speed"), np.array([9, 0, 4, 4, 3]))
    assert found["speed"].tolist() == [9.0, 0.0, 4.0, 4.0, 3.0]
    assert found["path"][:, 5, 1].tolist() == [9.0, 0.0, 4.0, 4.0, 3.0]
    found["speed"][:] = -1.0  # a copy
    assert Frames(tmp_path).column("speed").min() == 0.0


def test_the_episodes_of_another_folder_are_others(tmp_path: Path) -> None:
    fill(tmp_path / "a", 4)
    fill(tmp_path / "b", 4)
    frames = Frames(tmp_path / "a", tmp_path / "b")
    assert len(frames) == 8
    assert len(set(frames.column("episode").tolist())) == 4
    assert frames.arrays(("episode",), np.array([0, 7]))["episode"].tolist() == [0, 10_000_001]


def test_the_split_is_by_whole_episodes_and_always_the_same(tmp_path: Path) -> None:
    fill(tmp_path, 100, 100)
    frames = Frames(tmp_path)
    training, validation = frames.split(0.2)
    episodes = frames.column("episode")
    assert len(training) + len(validation) == 200
    assert not set(episodes[training]) & set(episodes[validation])
    assert 0.1 < len(validation) / 200 < 0.3
    assert np.array_equal(validation, Frames(tmp_path).split(0.2)[1])


def test_what_is_half_written_is_not_there(tmp_path: Path) -> None:
    fill(tmp_path, 4, 4)
    (tmp_path / "shard-00001" / "done.json").unlink()
    (tmp_path / ".shard-00002.part").mkdir()
    assert len(Frames(tmp_path)) == 4
    assert read_done(tmp_path, 1) is None
    done = read_done(tmp_path, 0)
    assert done is not None
    assert done["rows"] == 4


def test_a_shard_can_be_written_again_over_what_was_left(tmp_path: Path) -> None:
    fill(tmp_path, 4)
    left = tmp_path / ".shard-00000.part"
    left.mkdir()
    (left / "old.npy").write_bytes(b"?")
    fill(tmp_path, 2)
    assert Frames(tmp_path).names == ("episode", "path", "source", "speed")
    assert len(Frames(tmp_path)) == 2


def test_equal_content_has_an_equal_digest_and_other_content_another(tmp_path: Path) -> None:
    digests = []
    for name, first in (("a", 0), ("b", 0), ("c", 1)):
        fill(tmp_path / name, 3, first=first)
        done = read_done(tmp_path / name, 0)
        assert done is not None
        digests.append(done["sha256"])
    assert digests[0] == digests[1] != digests[2]


def test_folders_that_hold_nothing_or_do_not_fit_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no complete shards in .*nothing: collect some with"):
        Frames(tmp_path / "nothing")
    fill(tmp_path / "a", 2)
    write_shard(tmp_path / "b", 0, [{"speed": np.float32(0.0)}], {})
    with pytest.raises(UsageError, match="hold different arrays"):
        Frames(tmp_path / "a", tmp_path / "b")
    with pytest.raises(UnknownNameError, match="Did you mean 'speed'"):
        Frames(tmp_path / "a").column("sped")
