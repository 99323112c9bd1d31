"""Comfort of records whose motion was logged; each log is read once."""

from __future__ import annotations

from pathlib import Path

from pytest_drive_robust.bench2drive.results.motion_log import find_log, motion_from, read_log
from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.metrics.comfort import COMFORT_QUIRKS, Motion, comfort_of

__all__ = ["Comforts"]


class Comforts:
    """Looks for logs in `folders`, the first that has one."""

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = folders
        self._paths: dict[str, Path | None] = {}
        self._motions: dict[Path, tuple[Motion, Motion]] = {}

    def value(self, record: OfficialRecord, mode: str) -> float | None:
        """Return percent, None without a log or with too few samples. Raises `UsageError` for a damaged log."""
        return self.with_quirks(record, COMFORT_QUIRKS if mode == "bench2drive" else ())

    def with_quirks(self, record: OfficialRecord, quirks: tuple[str, ...]) -> float | None:
        """Compute `value` with some of the quirks. With any of them the samples are taken as they come."""
        path = self.path(record)
        if path is None:
            return None
        if path not in self._motions:
            log = read_log(path)
            self._motions[path] = motion_from(log.as_written, log.dt_s), motion_from(log.in_order, log.dt_s)
        return comfort_of(self._motions[path][0 if quirks else 1], quirks)

    def path(self, record: OfficialRecord) -> Path | None:
        """Return the log of a record."""
        name = record.save_name
        if name not in self._paths:
            found = (find_log(folder, name) for folder in self._folders)
            self._paths[name] = next((path for path in found if path is not None), None)
        return self._paths[name]

    def is_renamed(self, record: OfficialRecord) -> bool:
        """Return True when the log is in a folder of another name, where the official tool does not look."""
        path = self.path(record)
        return path is not None and path.parent.name != record.save_name
