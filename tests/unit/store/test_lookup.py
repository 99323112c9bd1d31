"""Stored episodes are found by their key, and one that cannot be read is named with what to do."""

from __future__ import annotations

import pytest
from result_factory import FULL

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.lookup import stored_episodes
from pytest_drive_robust.store.record_files import RecordFiles, write_episode


def test_an_episode_is_found_in_a_store_and_in_any_other_folder(tmp_path):
    store, kept = RecordFiles(tmp_path / "store"), tmp_path / "kept" / "deep"
    store.path("ab01").parent.mkdir(parents=True)
    kept.mkdir(parents=True)
    write_episode(store.path("ab01"), FULL)
    write_episode(kept / "cd01.episode", FULL)
    find = stored_episodes(store.folder, tmp_path / "kept")
    assert [found and found.episode for found in map(find, ("ab01", "cd01", "ef01"))] == [FULL.episode] * 2 + [None]


def test_what_a_store_has_set_aside_is_not_found(tmp_path):
    store = RecordFiles(tmp_path)
    store.write("ab01", b"damaged")
    assert store.set_aside("ab01")
    assert stored_episodes(tmp_path)("ab01") is None


def test_a_damaged_episode_is_named_with_its_file_its_damage_and_what_to_do(tmp_path):
    store = RecordFiles(tmp_path)
    store.write("ab01", b"damaged")
    with pytest.raises(UsageError) as refused:
        stored_episodes(tmp_path)("ab01")
    told = str(refused.value)
    assert f"the stored episode {str(store.path('ab01'))!r} cannot be read: it does not begin as a stored" in told
    assert "`drive-robust store verify --fix`" in told
