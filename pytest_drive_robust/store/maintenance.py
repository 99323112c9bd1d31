"""Maintains a store: counts its records, verifies them, and removes records that no run needs."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import Trace
from pytest_drive_robust.store.claims import Claims
from pytest_drive_robust.store.index import IndexedEpisode, indexed_episodes
from pytest_drive_robust.store.record import OtherFormatError, decode_record
from pytest_drive_robust.store.record_files import SUFFIX, FileState, RecordFiles
from pytest_drive_robust.store.reuse import ends_reusable

_DAY_S = 86_400.0
_TEMPORARY = ("episodes/*/.*.tmp", ".now-*.tmp", "..gitignore-*.tmp", ".CACHEDIR-*.tmp")
"""The temporary files that a dead writer may leave. Named exactly, since the root folder may hold files of others."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of a store: `by_agent` counts records by (agent, outcome), `wall_s` is the seconds of driving them."""

    folder: Path
    records: int
    size_bytes: int
    wall_s: float
    runs: int
    reusable: int
    by_agent: dict[tuple[str, str], int]
    unreadable: int
    set_aside: int


@dataclass(frozen=True, slots=True)
class Damage:
    """A record that cannot be used, and the `problem`.

    `later_version`: another version of this program wrote the record. `unread`: the disk or the file's permissions kept
    the record from being read, so its content may be whole.
    """

    key: str
    path: Path
    problem: str
    later_version: bool = False
    unread: bool = False

    @property
    def is_certain(self) -> bool:
        """True when no program can use the record: it was read, and no other version wrote it."""
        return not (self.later_version or self.unread)


@dataclass(frozen=True, slots=True)
class Swept:
    """The files that `sweep` removed, or would remove: counts by kind and the total `size_bytes`.

    `problems` names the files that could not be removed.
    """

    records: int
    damaged: int
    leftovers: int
    size_bytes: int
    problems: tuple[str, ...] = ()


def statistics(folder: Path) -> Statistics:
    """Return the statistics of a store. Reads only records that changed since the last time (see `index`)."""
    rows = indexed_episodes(RecordFiles(folder))
    whole = [row for row in rows if not row.problem]
    return Statistics(
        folder=folder,
        records=len(rows),
        size_bytes=sum(row.size for row in rows),
        wall_s=sum(row.wall_s for row in whole),
        runs=len({row.run for row in whole}),
        reusable=sum(_is_reusable(row) for row in whole),
        by_agent=dict(sorted(Counter((row.agent, row.outcome) for row in whole).items())),
        unreadable=len(rows) - len(whole),
        set_aside=len(_lying_aside(folder)),
    )


def verify(folder: Path) -> tuple[int, tuple[Damage, ...]]:
    """Read every record to its last byte and return (number of records, damaged records). Changes nothing."""
    files = RecordFiles(folder)
    keys = list(files.all_keys())
    return len(keys), tuple(damage for key in keys if (damage := _damage(files, key)) is not None)


def set_aside(folder: Path, damages: Iterable[Damage]) -> int:
    """Move damaged records to `aside/`, so that their episodes are driven again. Returns how many were moved.

    Each record is read again first, because a run may have replaced it. A record that is whole, of another version or
    unreadable stays.
    """
    files = RecordFiles(folder)
    found = (_damage(files, damage.key) for damage in damages)
    damaged = [damage for damage in found if damage is not None and damage.is_certain]
    return sum(files.set_aside(damage.key) is not None for damage in damaged)


def _damage(files: RecordFiles, key: str) -> Damage | None:
    """Return the damage of a record, or None when the record is whole or gone."""
    path = files.path(key)
    try:
        data = files.read(key)
        if data is None:
            return None
        trace = decode_record(data, key=key).result.trace
        whole = Trace(trace.rows).digest == trace.digest
    except OtherFormatError as error:
        return Damage(key, path, str(error), later_version=True)
    except ValueError as error:
        return Damage(key, path, str(error))
    except OSError as error:
        return Damage(key, path, f"it cannot be read: {error.strerror or error}", unread=True)
    return None if whole else Damage(key, path, "its trace is not the one that its header tells of")


def sweep(folder: Path, *, older_than_s: float | None = None, agents: Iterable[str] = (), dry: bool = False) -> Swept:
    """Remove the files that no run will read, and the records that the caller selects.

    Always removes damaged records, set aside or not. Removes after a day records that no other run may reuse, and
    temporary and lock files of dead writers. `older_than_s` also selects every record written longer ago, and `agents`
    every record of these agents; with both, a record must match both. A record of another format, whose agent is not
    known, is selected by its age alone. Records that a living process has claimed, or
    replaced meanwhile, stay. `dry` removes nothing.
    """
    files, claims, wanted = RecordFiles(folder), Claims(folder / "claims"), frozenset(agents)
    now_s = _now_s(folder)

    def goes(row: IndexedEpisode) -> bool:
        age_s = _age_s(files.path(row.key), now_s)
        if not _is_reusable(row) and age_s > _DAY_S:
            return True  # younger records stay: the run that drove them may still need them
        asked = older_than_s is not None or bool(wanted)
        return asked and age_s > (older_than_s or -1.0) and (not wanted or row.agent in wanted)

    states = {key: files.state(key) for key in files.all_keys()}  # before the index reads them
    rows = indexed_episodes(files)
    records = [files.path(row.key) for row in rows if not row.problem and goes(row)]
    found = [damage for row in rows if row.problem and (damage := _damage(files, row.key)) is not None]
    damaged = [damage.path for damage in found if damage.is_certain]
    if older_than_s is not None and not wanted:
        others = (damage.path for damage in found if damage.later_version)
        records += [path for path in others if _age_s(path, now_s) > older_than_s]
    aside = _lying_aside(folder)
    halves = [path for ours in _TEMPORARY for path in folder.glob(ours) if _age_s(path, now_s) > _DAY_S]
    locks = [path for path in folder.glob("claims/*.lock") if _age_s(path, now_s) > _DAY_S]
    sizes = {path: _size(path) for path in (*records, *damaged, *aside, *halves)}
    problems: list[str] = []
    if not dry:
        for path in (*records, *damaged, *locks):  # a lock that nobody holds goes with its release
            problems += _remove_unclaimed(path, claims, files, states.get(path.stem))
        for path in (*aside, *halves):
            problems += _remove(path)
    kinds = (records, damaged + aside, halves + locks)
    went = [[path for path in paths if dry or not path.exists()] for paths in kinds]
    size = sum(sizes.get(path, 0) for paths in went for path in paths)
    counts = [len(paths) for paths in went]
    return Swept(counts[0], counts[1], counts[2], size, tuple(problems))


def _remove_unclaimed(path: Path, claims: Claims, files: RecordFiles, state: FileState | None) -> list[str]:
    """Remove a record if its file is still in `state`: another run may have replaced the record meanwhile."""
    claim = claims.attempt(path.stem)
    if claim is None:
        return []
    with claim:
        return _remove(path) if path.suffix == SUFFIX and files.state(path.stem) == state else []


def _is_reusable(row: IndexedEpisode) -> bool:
    return not row.problem and ends_reusable(Outcome(row.outcome), End(row.end))


def _now_s(folder: Path) -> float:
    """Return the time in seconds by the clock that dates the files: on a network share, the server's clock."""
    probe = folder / f".now-{os.getpid()}.tmp"
    try:
        probe.touch()
        return probe.stat().st_mtime
    except OSError:
        return time.time()
    finally:
        _remove(probe)


def _age_s(path: Path, now_s: float) -> float:
    """Return the seconds since a file was written; 0 for a file from the future or without a readable time."""
    try:
        return max(0.0, now_s - path.stat().st_mtime)
    except OSError:
        return 0.0


def _lying_aside(folder: Path) -> list[Path]:
    return [path for path in folder.glob(f"aside/*{SUFFIX}") if path.is_file()]


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _remove(path: Path) -> list[str]:
    """Remove a file. Return why the file stays, or an empty list when it is gone."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        return [f"{path}: {error.strerror or error}"]
    return []
