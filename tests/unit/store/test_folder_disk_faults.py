from __future__ import annotations

import errno
import os

import pytest
from result_factory import make_result

from pytest_drive_robust.store import record_files, whole_file
from pytest_drive_robust.store.folder import FolderStore

KEYS = ("aa01", "aa02", "bb01")
CALLS = ("open", "write", "fsync", "replace", "close")


class Disk:
    """`os` whose `k`-th call that touches the disk fails; all later ones, too, when the disk stays `full`."""

    def __init__(self, fails_at: int, *, stays: bool, number: int, short_writes: bool = False) -> None:
        self.calls = 0
        self._fails_at = fails_at
        self._stays = stays
        self._number = number
        self._short = short_writes

    def __getattr__(self, name: str):
        real = getattr(os, name)
        if name not in CALLS:
            return real

        def call(*given):
            self.calls += 1
            if self.calls == self._fails_at or (self._stays and self.calls > self._fails_at):
                if name == "close":
                    real(*given)  # the descriptor is gone all the same
                raise OSError(self._number, os.strerror(self._number))
            if name == "write" and self._short:
                return real(given[0], given[1][:100])
            return real(*given)

        return call


def drive(folder, spill=None):
    store = FolderStore(folder, run="one", spill=spill)
    for key in KEYS:
        store.put(key, make_result(key))
    return store


def calls_of_a_whole_run(folder, monkeypatch):
    disk = Disk(0, stays=False, number=errno.EIO)
    monkeypatch.setattr(whole_file, "os", disk)
    drive(folder)
    monkeypatch.undo()
    return disk.calls


@pytest.mark.parametrize(
    ("number", "stays"),
    [(errno.EIO, False), (errno.ENOSPC, True), (errno.EROFS, True)],
    ids=["one call fails", "disk full from there on", "read-only from there on"],
)
def test_whatever_call_fails_nothing_is_lost_and_nothing_half_written(tmp_path, monkeypatch, number, stays):
    calls = calls_of_a_whole_run(tmp_path / "quiet", monkeypatch)
    assert calls > 15
    for k in range(1, calls + 1):
        folder, spill = tmp_path / f"{k}", None if stays else tmp_path / f"spill {k}"
        monkeypatch.setattr(whole_file, "os", Disk(k, stays=stays, number=number))
        store = drive(folder, spill)
        assert [store.get(key).episode.route_id for key in KEYS] == list(KEYS)  # this run goes on
        assert len(store.problems()) == 1, k
        assert os.strerror(number) in store.problems()[0]
        monkeypatch.undo()
        later = FolderStore(folder, run="two")
        found = [later.get(key) for key in KEYS]
        assert later.problems() == ()  # nothing that looks like a record is damaged
        assert [item.episode.route_id for item in found if item is not None] == [
            key for key, item in zip(KEYS, found, strict=True) if item is not None
        ]
        if spill is not None:
            assert sum(item is None for item in found) <= 1
            beside = FolderStore(folder, run="one", spill=spill)
            assert [beside.get(key).episode.route_id for key in KEYS] == list(KEYS)
        assert not list(folder.rglob("*.tmp"))


def test_what_the_store_does_not_take_goes_to_the_folder_of_the_run(tmp_path, monkeypatch):
    store = FolderStore(tmp_path / "store", run="one", spill=tmp_path / "spill")
    real = record_files.RecordFiles.write

    def full(self, key, data):
        if self.folder == tmp_path / "store":
            raise OSError(errno.ENOSPC, "No space left on device")
        real(self, key, data)

    monkeypatch.setattr(record_files.RecordFiles, "write", full)
    store.put("aa01", make_result("aa01"))
    beside = FolderStore(tmp_path / "store", run="one", spill=tmp_path / "spill")
    assert beside.get("aa01").episode.route_id == "aa01"
    assert len(store.problems()) == 1
    assert "cannot be written to (No space left on device). This run goes on" in store.problems()[0]


def test_writes_that_take_a_part_only_are_gone_on_with(tmp_path, monkeypatch):
    monkeypatch.setattr(whole_file, "os", Disk(0, stays=False, number=0, short_writes=True))
    drive(tmp_path)
    monkeypatch.undo()
    assert FolderStore(tmp_path, run="two").get("aa01").episode.route_id == "aa01"


def test_a_file_where_the_folder_should_be_stops_nothing(tmp_path):
    (tmp_path / "store").write_text("mine")
    store = drive(tmp_path / "store")
    assert [store.get(key).episode.route_id for key in KEYS] == list(KEYS)
    assert store.claim("aa01") is not None
    assert len(store.problems()) == 1
    assert (tmp_path / "store").read_text() == "mine"


def test_a_record_that_cannot_be_read_is_driven_again(tmp_path, monkeypatch):
    drive(tmp_path)

    def broken(self, key):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(record_files.RecordFiles, "read", broken)
    store = FolderStore(tmp_path, run="two")
    assert store.get("aa01") is None
    assert store.get("aa01") is None
    (problem,) = store.problems()
    assert problem.endswith("could not be read (Input/output error), so that episode is driven again.")


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="permissions do not bind this user")
def test_a_store_without_write_permission_is_read(tmp_path):
    drive(tmp_path)
    os.chmod(tmp_path / "episodes" / "aa", 0o500)
    try:
        store = FolderStore(tmp_path, run="two")
        assert store.get("aa01") is not None
        store.put("aa03", make_result("aa03"))
        assert len(store.problems()) == 1
    finally:
        os.chmod(tmp_path / "episodes" / "aa", 0o700)
