from __future__ import annotations

import contextlib
import sqlite3
import threading
from dataclasses import replace

import pytest
from result_factory import make_result

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.store import index
from pytest_drive_robust.store.index import indexed_episodes
from pytest_drive_robust.store.record_files import RecordFiles


def test_the_index_reads_only_what_changed(store, monkeypatch):
    files = RecordFiles(store.folder)
    before = indexed_episodes(files)
    store.put("cc01", make_result("9"))
    files.path("aa01").unlink()
    store.put("bb02", make_result("3"))
    read = []
    monkeypatch.setattr(index.RecordFiles, "read", lambda self, key: read.append(key) or self.path(key).read_bytes())
    after = indexed_episodes(files)
    assert read == ["bb02", "cc01"]
    assert [row.key for row in before] == ["aa01", "aa02", "bb01", "bb02"]
    assert [(row.key, row.outcome) for row in after] == [
        ("aa02", "failed"),
        ("bb01", "completed"),
        ("bb02", "completed"),
        ("cc01", "completed"),
    ]


@pytest.mark.parametrize("content", [None, b"", b"nonsense" * 1000, "another version", "another table"])
def test_the_index_can_be_lost_damaged_or_of_another_version(store, content):
    files = RecordFiles(store.folder)
    before, path = indexed_episodes(files), store.folder / "index.sqlite"
    if content is None:
        path.unlink()
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        with sqlite3.connect(path) as database:
            database.execute("DROP TABLE records")
            database.execute("CREATE TABLE records (something TEXT)")
            database.execute(f"PRAGMA user_version = {99 if content == 'another version' else index._VERSION}")
        database.close()
    assert indexed_episodes(files) == before
    assert indexed_episodes(files) == before


def test_what_a_later_version_wrote_into_the_index_is_not_read(store):
    files = RecordFiles(store.folder)
    before = indexed_episodes(files)
    with contextlib.closing(sqlite3.connect(store.folder / "index.sqlite")) as database, database:
        database.execute("UPDATE records SET agent = 'what this column means then'")
        database.execute("PRAGMA user_version = 99")
    assert indexed_episodes(files) == before


def test_an_index_that_another_command_is_writing_stays_and_its_table_is_made_in_memory(store, monkeypatch):
    files, path = RecordFiles(store.folder), store.folder / "index.sqlite"
    indexed_episodes(files)
    store.put("cc01", make_result("9"))
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda place, timeout=0.0: connect(place, timeout=min(timeout, 0.05)))
    before = path.stat().st_ino
    with contextlib.closing(connect(path)) as other:
        other.execute("BEGIN IMMEDIATE")
        assert len(indexed_episodes(files)) == 5
        assert path.stat().st_ino == before
        other.execute("ROLLBACK")
    assert len(indexed_episodes(files)) == 5
    assert path.stat().st_ino == before


def test_two_commands_that_make_the_index_at_once_make_one(store):
    files = RecordFiles(store.folder)
    started, found = threading.Barrier(4), []

    def look():
        started.wait()
        found.append(indexed_episodes(files))

    for _ in range(10):
        (store.folder / "index.sqlite").unlink(missing_ok=True)
        threads = [threading.Thread(target=look) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert (store.folder / "index.sqlite").exists()
    assert [len(rows) for rows in found] == [4] * 40


def test_the_index_holds_names_and_numbers_that_sqlite_does_not(store):
    odd = replace(make_result(), episode=Episode("a\udcff", "../x\0y", "e" * 10_000, 2**80))
    store.put("dd01", odd)
    (row,) = [row for row in indexed_episodes(RecordFiles(store.folder)) if row.key == "dd01"]
    assert (row.agent, row.route_id, row.seed) == ("a\\udcff", "../x\0y", 2**80)
