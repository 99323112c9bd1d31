"""The store among real processes that are killed at any moment."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import store_holder
from patience import PATIENCE_S
from store_holder import episode, key_of

from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.store.maintenance import verify

HOLDER = Path(store_holder.__file__)


@contextmanager
def holder(folder, *words):
    command = [sys.executable, str(HOLDER), str(folder), *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def test_a_claim_is_free_as_soon_as_its_holder_is_killed(tmp_path):
    store = FolderStore(tmp_path, run="r")
    with holder(tmp_path, "hold", "abcd") as process:
        assert process.stdout.readline() == "held\n"
        assert store.claim("abcd") is None
        with holder(tmp_path, "hold", "abcd") as second:
            assert second.stdout.readline() == "taken\n"
        process.kill()
        process.wait()
        with store.claim("abcd") as claim:
            assert claim is not None


def test_killed_writers_lose_nothing_that_they_acknowledged(tmp_path):
    acknowledged: list[int] = []
    for round_ in range(5):
        with holder(tmp_path, "write", 1000 * round_) as one, holder(tmp_path, "write", 1000 * round_ + 500) as two:
            one.stdout.readline()
            two.stdout.readline()
            acknowledged += [1000 * round_, 1000 * round_ + 500]
            time.sleep(0.02 + 0.013 * round_)  # any moment will do
            for process in (one, two):
                process.kill()
            for process in (one, two):
                acknowledged += [int(line) for line in process.stdout.read().splitlines()]
    count, damages = verify(tmp_path)
    assert damages == ()
    assert count >= len(acknowledged)
    store = FolderStore(tmp_path, run="later")
    for number in acknowledged:
        assert store.get(key_of(number)).trace.rows.tobytes() == episode(number).trace.rows.tobytes()
    assert store.problems() == ()


def test_processes_that_want_the_same_episodes_drive_each_once(tmp_path):
    with holder(tmp_path, "share", 60, 1, 2) as one, holder(tmp_path, "share", 60, 2, 2) as two:
        told = [process.communicate(timeout=PATIENCE_S)[0].split() for process in (one, two)]
    assert sorted(int(number) for driven in told for number in driven) == list(range(60))
    assert all(told)
    assert list((tmp_path / "claims").iterdir()) == []


def test_what_a_killed_process_was_driving_is_driven_by_the_next_one(tmp_path):
    with holder(tmp_path, "hold", key_of(7)) as stuck:
        assert stuck.stdout.readline() == "held\n"
        with holder(tmp_path, "share", 10, 1) as other:
            others = [int(other.stdout.readline()) for _ in range(9)]
            assert sorted(others) == [0, 1, 2, 3, 4, 5, 6, 8, 9]
            stuck.kill()
            assert other.communicate(timeout=PATIENCE_S)[0].split() == ["7"]


@pytest.mark.skipif(os.name == "nt", reason="no such limit there")
@pytest.mark.parametrize("most_bytes", [0, 1, 20_000])
def test_a_system_that_takes_a_part_of_a_file_leaves_none(tmp_path, most_bytes):
    with holder(tmp_path, "cramp", most_bytes) as process:
        kept, problems = process.communicate(timeout=PATIENCE_S)[0].splitlines()
    assert kept == "True"
    assert "cannot be written to (File too large). This run goes on" in problems
    assert [path.name for path in tmp_path.rglob("*") if path.is_file() and "episodes" in path.parts] == []
    assert FolderStore(tmp_path, run="later").get(key_of(1)) is None
