from __future__ import annotations

import os
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


def test_a_record_that_was_replaced_has_another_state_at_the_same_size_and_time(tmp_path):
    files, states = RecordFiles(tmp_path), []
    for data in (b"one", b"two"):
        files.write("abcdef", data)
        os.utime(files.path("abcdef"), ns=(10**18, 10**18))
        states.append(files.state("abcdef"))
    assert states[0] != states[1]


def test_a_record_that_cannot_be_read_is_not_taken_for_one_that_is_missing(tmp_path):
    files = RecordFiles(tmp_path)
    assert files.read("abcdef") is None
    files.path("abcdef").mkdir(parents=True)
    with pytest.raises(OSError, match=r"abcdef\.episode"):
        files.read("abcdef")


def test_what_a_writer_that_died_left_is_no_record(tmp_path):
    files = RecordFiles(tmp_path)
    files.write("abcdef", b"one")
    files.path("abcdef").with_name(".abcdef-7-00ff.tmp").write_bytes(b"o")
    assert list(files.all_keys()) == ["abcdef"]


def test_a_store_beside_what_the_evaluator_drove_is_hidden_from_git_and_one_beside_other_things_is_not(tmp_path):
    for other, hidden in (("bench2drive", True), ("thesis", False)):
        store = tmp_path / f"beside {other}"
        (store / other).mkdir(parents=True)
        RecordFiles(store).write("abcdef", b"an episode")
        assert [(store / name).exists() for name in (".gitignore", "CACHEDIR.TAG")] == [hidden, hidden], other
