"""The store on disk: finished episodes of this run and of earlier ones, shared by every process that opens it.

Two runs may use one folder at once, on one machine or over a network file system. The store is correct without locks:
files appear whole (see `whole_file`) and the same key means the same bits. Claims (see `claims`) only save double work.

On a network file system other hosts see a record as soon as it was renamed, because they open the record by its name.
A mount may remember for a while that a name was missing (`acdirmax`, a minute at most for NFS); a host that looks too
early drives the episode once more and gets the same bits. Where locks are local to each host (`nolock`, many FUSE and
Lustre mounts without `flock`), two hosts may drive an episode twice, but never two processes of one host. No clock and
no age of a file decides anything, except in `drive-robust store gc`, which asks the server for the time.
"""

from __future__ import annotations

from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.claims import Claim, Claims
from pytest_drive_robust.store.record import (
    CorruptRecordError,
    EpisodeRecord,
    OtherFormatError,
    decode_record,
    encode_episode,
)
from pytest_drive_robust.store.record_files import FileState, RecordFiles
from pytest_drive_robust.store.reuse import is_reusable


class FolderStore:
    """Keeps episodes in `folder`. The folder is created when the first episode is stored or claimed.

    `run` names this run. `get` returns every episode that this run drove, and of other runs the episodes that would end
    equally if driven again (see `is_reusable`); with `fresh` no episode of another run.

    Some episodes cannot go to `folder`: the disk is full, the permission is missing, or this run has a time-out where
    another run stored a whole drive. The store keeps such episodes in memory and in `spill`, a folder that all
    processes of this run share. Without `spill` no other process sees them.
    """

    def __init__(self, folder: Path, *, run: str = "", fresh: bool = False, spill: Path | None = None) -> None:
        self._files = RecordFiles(folder)
        self._spill = None if spill is None else RecordFiles(spill)
        self._claims = Claims(*(place / "claims" for place in (folder, spill) if place is not None))
        self._run = run
        self._fresh = fresh
        self._known: dict[str, EpisodeResult] = {}
        self._useless: dict[tuple[Path, str], FileState | None] = {}
        self._problems: dict[str, None] = {}
        self._unwritten = False

    @property
    def folder(self) -> Path:
        """The folder of the store."""
        return self._files.folder

    def get(self, key: str) -> EpisodeResult | None:
        """Return the finished episode, or None when it must be driven. A damaged record is set aside, not counted."""
        known = self._known.get(key)
        if known is not None:
            return known
        for files in (self._spill, self._files):  # an episode that this run drove wins over another run's
            found = None if files is None else self._found(files, key)
            if found is not None:
                self._known[key] = found
                return found
        return None

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode; other processes see the whole record or none.

        When `result` is not reusable but the folder holds a reusable record of the key, only this run keeps `result`.
        """
        self._known[key] = result
        data = encode_episode(result, {"key": key, "run": self._run})
        if not is_reusable(result) and self._has_reusable(key):
            self._write_spill(key, data)
            return
        try:
            self._files.write(key, data)
        except OSError as error:
            self._tell_unwritten(error)
            self._write_spill(key, data)

    def claim(self, key: str) -> Claim | None:
        """Return the right to drive an episode, or None when a living process drives it already. Never waits."""
        return self._claims.attempt(key)

    def problems(self) -> tuple[str, ...]:
        """Return the problems of the folder and its files, one sentence for each; no sentence occurs twice."""
        return tuple(self._problems)

    def _has_reusable(self, key: str) -> bool:
        try:
            data = self._files.read(key)
            return data is not None and is_reusable(decode_record(data, key=key).result)
        except (CorruptRecordError, OSError):
            return False

    def _found(self, files: RecordFiles, key: str) -> EpisodeResult | None:
        seen, state = (files.folder, key), files.state(key)
        if seen in self._useless and self._useless[seen] == state:
            return None  # this file was of no use before, and is unchanged
        try:
            data = files.read(key)
        except OSError as error:
            self._tell(
                f"{files.path(key)} could not be read ({error.strerror or error}), so that episode is driven again."
            )
            self._useless[seen] = state
            return None
        if data is None:
            return None
        record = self._record(files, key, data)
        if record is None or not self._counts(record):
            self._useless[seen] = state
            return None
        return record.result

    def _record(self, files: RecordFiles, key: str, data: bytes) -> EpisodeRecord | None:
        try:
            return decode_record(data, key=key)
        except OtherFormatError:
            return None
        except CorruptRecordError as error:
            place = files.set_aside(key)
            what = "It could not be moved away" if place is None else f"It was moved to {place}"
            self._tell(
                f"the stored episode {files.path(key)} is damaged: {error}. {what}; the episode is driven again."
            )
            return None

    def _counts(self, record: EpisodeRecord) -> bool:
        if record.notes.get("run") == self._run:
            return True
        return not self._fresh and is_reusable(record.result)

    def _tell_unwritten(self, error: OSError) -> None:
        if not self._unwritten:
            self._unwritten = True
            self._tell(
                f"the store {self._files.folder} cannot be written to ({error.strerror or error}). This run goes on "
                "and its verdicts stand, but what it could not write is not there for later runs. Make room, or "
                "choose another folder with --drive-store PATH."
            )

    def _write_spill(self, key: str, data: bytes) -> None:
        if self._spill is None:
            return
        try:
            self._spill.write(key, data)
        except OSError as error:
            self._tell(f"{self._spill.folder} cannot be written to either ({error.strerror or error}).")

    def _tell(self, sentence: str) -> None:
        self._problems.setdefault(sentence)
