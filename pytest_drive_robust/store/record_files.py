"""Reads and writes episode files: a single file, or a folder with one file per key. Only these files are the store."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.store.whole_file import make_folder_synced, write_whole

SUFFIX = ".episode"

_CACHE_TAG = "Signature: 8a477f597d28d172789f06886806bc55\n# Episodes that pytest-drive-robust drove: safe to delete.\n"
"""The content of `CACHEDIR.TAG`, whose first line marks a cache for backup programs (bford.info/cachedir)."""
_IGNORE_FILE = ".gitignore"
_OURS = frozenset({"episodes", "claims", "aside", "runs", "bench2drive", "index.sqlite", _IGNORE_FILE, "CACHEDIR.TAG"})

FileState = tuple[int, int, int]
"""The inode, modification time in ns and size in bytes of a file; differs after the file was replaced."""


def is_store(folder: Path) -> bool:
    """Return whether a folder is a store: it has an `episodes` folder or a `CACHEDIR.TAG`, or is empty."""
    return (folder / "episodes").is_dir() or (folder / "CACHEDIR.TAG").is_file() or not any(folder.iterdir())


def hide_from_git(folder: Path) -> None:
    """Write a `.gitignore` that excludes all of `folder`, which is large and local to a machine. Raises `OSError`."""
    if not (folder / _IGNORE_FILE).exists():
        write_whole(folder / _IGNORE_FILE, "*\n", synced=True)


def write_episode(path: Path, result: EpisodeResult) -> None:
    """Write `result` to `path`; the file is either absent or whole, even after a crash or a power cut."""
    write_whole(path, encode_episode(result), synced=True)


def read_episode(path: Path) -> EpisodeResult:
    """Return the episode in `path`, bit for bit.

    Raises `CorruptRecordError` (a `ValueError`) for a file that is no whole record, `OSError` when there is no file.
    """
    return decode_episode(path.read_bytes())


class RecordFiles:
    """The record files below `folder` (`episodes/ab/abcdef.episode`). The first write creates the folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._episodes = folder / "episodes"

    def path(self, key: str) -> Path:
        """Return the path of the record of a key, whether or not the record exists."""
        return self._episodes / key[:2] / f"{key}{SUFFIX}"

    def read(self, key: str) -> bytes | None:
        """Return the bytes of a record, or None when there is no record. Raises `OSError` for an unreadable file."""
        try:
            return self.path(key).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None

    def state(self, key: str) -> FileState | None:
        """Return the state of the file of a key, or None when there is no file."""
        try:
            found = os.stat(self.path(key))
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns, found.st_size

    def write(self, key: str, data: bytes) -> None:
        """Write `data` as the record of a key. Raises `OSError`; an older record then stays untouched."""
        path = self.path(key)
        if not path.parent.is_dir():
            self._make(path.parent)
        write_whole(path, data, synced=True)

    def set_aside(self, key: str) -> Path | None:
        """Move a record to `aside/`. Returns the new path, or None when the record could not be moved."""
        path = self.path(key)
        aside = self.folder / "aside"
        number = 1
        target = aside / path.name
        try:
            aside.mkdir(parents=True, exist_ok=True)
            while target.exists():
                number += 1
                target = aside / f"{key}.{number}{SUFFIX}"
            os.replace(path, target)
        except OSError:
            return None
        return target

    def all_keys(self) -> Iterator[str]:
        """Yield every key that has a record, sorted within each of the 256 folders."""
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            for shard in sorted(os.listdir(self._episodes)):
                with contextlib.suppress(FileNotFoundError, NotADirectoryError):
                    names = sorted(os.listdir(self._episodes / shard))
                    yield from (name.removesuffix(SUFFIX) for name in names if name.endswith(SUFFIX))

    def _make(self, shard: Path) -> None:
        make_folder_synced(shard)
        # Other files in the folder belong to the user and must stay visible to git.
        if set(os.listdir(self.folder)) <= _OURS:
            hide_from_git(self.folder)
            if not (self.folder / "CACHEDIR.TAG").exists():
                write_whole(self.folder / "CACHEDIR.TAG", _CACHE_TAG, synced=True)
