from __future__ import annotations

import errno
import os

import pytest

from pytest_drive_robust.store.folder import FolderStore

KEY = "abcdef0123456789"


def test_a_claim_is_held_by_one_and_free_after_it(tmp_path):
    first, second = FolderStore(tmp_path), FolderStore(tmp_path)
    claim = first.claim(KEY)
    assert claim is not None
    assert second.claim(KEY) is None
    assert first.claim(KEY) is None
    assert second.claim("abcd") is not None
    claim.release()
    with second.claim(KEY):
        assert first.claim(KEY) is None
    assert first.claim(KEY) is not None


def test_a_claim_that_is_given_back_twice_frees_no_other(tmp_path):
    store = FolderStore(tmp_path)
    first = store.claim(KEY)
    first.release()
    with store.claim(KEY):
        first.release()
        assert store.claim(KEY) is None


def test_released_claims_leave_no_files(tmp_path):
    store = FolderStore(tmp_path)
    for number in range(20):
        store.claim(f"{number:04x}").release()
    assert list((tmp_path / "claims").iterdir()) == []


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS])
def test_without_a_lock_service_everybody_gets_the_claim(tmp_path, monkeypatch, number):
    def no_locks(*_: object) -> bool:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("msvcrt.locking" if os.name == "nt" else "fcntl.flock", no_locks)
    one, other = FolderStore(tmp_path), FolderStore(tmp_path)
    assert one.claim(KEY) is not None
    assert other.claim(KEY) is not None


def test_where_the_store_has_no_locks_the_folder_of_the_run_has(tmp_path):
    (tmp_path / "store").write_text("no folder")
    one, other = (FolderStore(tmp_path / "store", run="r", spill=tmp_path / "spill") for _ in range(2))
    with one.claim(KEY):
        assert other.claim(KEY) is None
    assert other.claim(KEY) is not None
