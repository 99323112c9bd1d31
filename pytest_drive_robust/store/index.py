"""A table of what is in a store, for questions about many records: `index.sqlite` beside them.

It is made of the records and can be deleted at any time. Nobody but the commands that show and tidy a store reads it:
whether an episode must be driven is asked of its file alone. A damaged index, or one of another version, is made anew.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_drive_robust.store.record import CorruptRecordError, EpisodeRecord, decode_record
from pytest_drive_robust.store.record_files import RecordFiles

_FILE = "index.sqlite"
_VERSION = 1
_COLUMNS = "key, state, size, run, agent, route_id, setting, seed, outcome, end, wall_s, problem"


@dataclass(frozen=True, slots=True)
class IndexedEpisode:
    """One record. `size` in bytes; `problem` says why it cannot be read, then the words of the episode are empty."""

    key: str
    size: int
    run: str = ""
    agent: str = ""
    route_id: str = ""
    setting: str = ""
    seed: int = 0
    outcome: str = ""
    end: str = ""
    wall_s: float = 0.0
    problem: str = ""


def indexed_episodes(files: RecordFiles) -> list[IndexedEpisode]:
    """Return what each record of a store says, in the order of keys. Only files that changed since then are read."""
    try:
        with contextlib.closing(_open(files.folder / _FILE)) as database:
            return _updated(database, files)
    except (sqlite3.Error, OSError):
        with contextlib.suppress(OSError):
            (files.folder / _FILE).unlink()
        with contextlib.closing(sqlite3.connect(":memory:")) as database:  # the folder may be read-only
            _create(database)
            return _updated(database, files)


def _open(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path, timeout=5.0)
    try:
        (version,) = database.execute("PRAGMA user_version").fetchone()
        if version != _VERSION:
            database.execute("DROP TABLE IF EXISTS records")
            _create(database)
    except BaseException:
        database.close()
        raise
    return database


def _create(database: sqlite3.Connection) -> None:
    with database:
        database.execute(
            "CREATE TABLE records (key TEXT PRIMARY KEY, state TEXT, size INTEGER, run TEXT, agent TEXT, route_id TEXT,"
            " setting TEXT, seed TEXT, outcome TEXT, end TEXT, wall_s REAL, problem TEXT)"
        )
        database.execute(f"PRAGMA user_version = {_VERSION}")


def _updated(database: sqlite3.Connection, files: RecordFiles) -> list[IndexedEpisode]:
    known: dict[str, str] = dict(database.execute("SELECT key, state FROM records"))
    there = {key: _state(files, key) for key in files.all_keys()}
    with database:
        gone = [(key,) for key in known.keys() - there.keys()]
        database.executemany("DELETE FROM records WHERE key = ?", gone)
        changed = _read(files, {key: state for key, state in there.items() if known.get(key) != state})
        marks = ",".join("?" * len(_COLUMNS.split(",")))
        database.executemany(f"INSERT OR REPLACE INTO records ({_COLUMNS}) VALUES ({marks})", changed)
    found = database.execute(f"SELECT {_COLUMNS} FROM records ORDER BY key")
    return [_episode(*values) for values in found]


def _episode(
    key: str, _: str, size: int, run: str, agent: str, route_id: str, setting: str, seed: str, *end: Any
) -> IndexedEpisode:
    return IndexedEpisode(key, size, run, agent, route_id, setting, int(seed), *end)


def _state(files: RecordFiles, key: str) -> str:
    return ":".join(map(str, files.state(key) or ()))


def _read(files: RecordFiles, states: Mapping[str, str]) -> Iterator[tuple[object, ...]]:
    for key, state in states.items():
        try:
            data = files.read(key)
        except OSError as error:
            yield (key, state, 0, *[""] * 4, "0", "", "", 0.0, f"it cannot be read: {error.strerror or error}")
            continue
        if data is not None:
            yield (key, state, len(data), *_words(key, data))


def _words(key: str, data: bytes) -> tuple[object, ...]:
    try:
        record = decode_record(data)
    except CorruptRecordError as error:
        return (*[""] * 4, "0", "", "", 0.0, str(error))
    if record.notes.get("key") != key:
        return (*[""] * 4, "0", "", "", 0.0, f"it is the record of {record.notes.get('key')!r}")
    return _facts(record)


def _facts(record: EpisodeRecord) -> tuple[object, ...]:
    result = record.result
    texts = (record.notes.get("run", ""), result.episode.agent, result.episode.route_id, result.episode.setting)
    return (
        *(text.encode(errors="backslashreplace").decode() for text in texts),  # SQLite takes no lone surrogates
        str(result.episode.seed),  # nor whole numbers of more than 64 bits
        result.outcome.value,
        result.end.value,
        float(result.wall_s),
        "",
    )
