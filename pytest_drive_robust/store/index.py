"""An index of the records in a store, `index.sqlite` in its folder, for questions about many records.

The index is built from the records and can be deleted at any time. Only the commands that show and clean a store read
the index; a run asks the record file itself whether an episode must be driven. A damaged index, or an index of another
version, is built again.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.store.record import CorruptRecordError, decode_record
from pytest_drive_robust.store.record_files import RecordFiles
from pytest_drive_robust.store.reuse import ran_out

_FILE = "index.sqlite"
_VERSION = 2


@dataclass(frozen=True, slots=True)
class IndexedEpisode:
    """One record; `size` is in bytes. `problem` says why the record is unreadable; then the episode's fields are empty.

    `end` is `AGENT_CRASHED_HARD` when the agent raised for lack of memory, so that no other run reuses the record.
    """

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


_NAMES = tuple(item.name for item in fields(IndexedEpisode))


def indexed_episodes(files: RecordFiles) -> list[IndexedEpisode]:
    """Return the index row of each record, sorted by key. Reads only records that changed since they were indexed."""
    if next(files.all_keys(), None) is None and not (files.folder / _FILE).exists():
        return []  # write no index into a folder without records
    try:
        with contextlib.closing(_open(files.folder / _FILE)) as database:
            return _updated(database, files)
    except (sqlite3.Error, OSError) as error:
        if "locked" not in str(error):  # a locked index is in use by another command: leave it
            with contextlib.suppress(OSError):
                (files.folder / _FILE).unlink()
        with contextlib.closing(sqlite3.connect(":memory:")) as database:  # the folder may be read-only
            _create(database)
            return _updated(database, files)


def _open(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path, timeout=5.0)
    try:
        if _version(database) != _VERSION:
            with database:
                database.execute("BEGIN IMMEDIATE")  # another command may create the table at the same time
                if _version(database) != _VERSION:
                    database.execute("DROP TABLE IF EXISTS records")
                    _create(database)
    except BaseException:
        database.close()
        raise
    return database


def _version(database: sqlite3.Connection) -> int:
    (version,) = database.execute("PRAGMA user_version").fetchone()
    return int(version)


def _create(database: sqlite3.Connection) -> None:
    database.execute(
        "CREATE TABLE records (key TEXT PRIMARY KEY, state TEXT, size INTEGER, run TEXT, agent TEXT, route_id TEXT,"
        " setting TEXT, seed TEXT, outcome TEXT, end TEXT, wall_s REAL, problem TEXT)"
    )
    database.execute(f"PRAGMA user_version = {_VERSION}")


def _updated(database: sqlite3.Connection, files: RecordFiles) -> list[IndexedEpisode]:
    known: dict[str, str] = dict(database.execute("SELECT key, state FROM records"))
    there = {key: ":".join(map(str, files.state(key) or ())) for key in files.all_keys()}
    with database:
        gone = [(key,) for key in known.keys() - there.keys()]
        database.executemany("DELETE FROM records WHERE key = ?", gone)
        changed = _read(files, {key: state for key, state in there.items() if known.get(key) != state})
        names = ("state", *_NAMES)
        marks = ", ".join(f":{name}" for name in names)
        database.executemany(f"INSERT OR REPLACE INTO records ({', '.join(names)}) VALUES ({marks})", changed)
    found = database.execute(f"SELECT {', '.join(_NAMES)} FROM records ORDER BY key")
    rows = [dict(zip(_NAMES, values, strict=True)) for values in found]
    return [IndexedEpisode(**{**row, "seed": int(row["seed"])}) for row in rows]


def _read(files: RecordFiles, states: Mapping[str, str]) -> Iterator[dict[str, object]]:
    """Yield the row of each record that exists. Seeds are text: SQLite's whole numbers have 64 bits at most."""
    for key, state in states.items():
        try:
            data = files.read(key)
            episode = None if data is None else _episode(key, data)
        except OSError as error:
            episode = IndexedEpisode(key, 0, problem=f"it cannot be read: {error.strerror or error}")
        if episode is not None:
            yield {**asdict(episode), "state": state, "seed": str(episode.seed)}


def _episode(key: str, data: bytes) -> IndexedEpisode:
    try:
        record = decode_record(data, key=key)
    except CorruptRecordError as error:
        return IndexedEpisode(key, len(data), problem=str(error))
    result = record.result
    texts = (record.notes.get("run", ""), result.episode.agent, result.episode.route_id, result.episode.setting)
    # SQLite takes no lone surrogates
    run, agent, route_id, setting = (text.encode(errors="backslashreplace").decode() for text in texts)
    end, wall_s = (End.AGENT_CRASHED_HARD if ran_out(result) else result.end).value, float(result.wall_s)
    return IndexedEpisode(
        key, len(data), run, agent, route_id, setting, result.episode.seed, result.outcome.value, end, wall_s
    )
