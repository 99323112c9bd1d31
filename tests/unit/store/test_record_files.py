from __future__ import annotations

from dataclasses import replace

import pytest
from result_factory import FULL

from pytest_drive_robust.store import whole_file
from pytest_drive_robust.store.record_files import RecordFiles, read_episode, write_episode


def test_an_episode_comes_back_to_the_bit(tmp_path):
    write_episode(tmp_path / "one.episode", FULL)
    back = read_episode(tmp_path / "one.episode")
    assert back.trace.digest == FULL.trace.digest
    assert back.trace.rows.tobytes() == FULL.trace.rows.tobytes()
    assert replace(back, trace=FULL.trace) == FULL


def test_nothing_is_left_when_writing_breaks(tmp_path, monkeypatch):
    def full_disk(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(whole_file.os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space left"):
        write_episode(tmp_path / "one.episode", FULL)
    assert list(tmp_path.iterdir()) == []


def test_a_store_beside_what_the_evaluator_drove_is_hidden_from_git_and_one_beside_other_things_is_not(tmp_path):
    for other, hidden in (("bench2drive", True), ("thesis", False)):
        store = tmp_path / f"beside {other}"
        (store / other).mkdir(parents=True)
        RecordFiles(store).write("abcdef", b"an episode")
        assert [(store / name).exists() for name in (".gitignore", "CACHEDIR.TAG")] == [hidden, hidden], other
