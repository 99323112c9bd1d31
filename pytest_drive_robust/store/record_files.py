"""Episodes as files: one alone, and a folder with one for each key. The files are the only truth of the store."""

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
"""By this first line backup programs know a cache (bford.info/cachedir)."""
_IGNORE_FILE = ".gitignore"
_OURS = frozenset({"episodes", "claims", "aside", "runs", "bench2drive", "index.sqlite", _IGNORE_FILE, "CACHEDIR.TAG"})

FileState = tuple[int, int, int]
"""What changes when a file is replaced: inode, time of change, size."""


def is_store(folder: Path) -> bool:
    """Return whether a folder holds records, or was made to; an empty one will do."""
    return (folder / "episodes").is_dir() or (folder / "CACHEDIR.TAG").is_file() or not any(folder.iterdir())


def hide_from_git(folder: Path) -> None:
    """Let git pass over all that is in `folder`: it is large and belongs to one machine. Raises `OSError`."""
    if not (folder / _IGNORE_FILE).exists():
        write_whole(folder / _IGNORE_FILE, "*\n", synced=True)


def write_episode(path: Path, result: EpisodeResult) -> None:
    """Write `result` so that `path` is either absent or whole, whenever the process dies or the power goes."""
    write_whole(path, encode_episode(result), synced=True)


def read_episode(path: Path) -> EpisodeResult:
    """Return the episode in `path`, bit for bit.

    Raises `CorruptRecordError` (a `ValueError`) for a file that is no whole one, `OSError` where there is no file.
    """
    return decode_episode(path.read_bytes())


class RecordFiles:
    """The records below `folder` (`episodes/ab/abcdef.episode`), which is made when the first one is written."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._episodes = folder / "episodes"

    def path(self, key: str) -> Path:
        """Return where the record of a key is, or would be."""
        return self._episodes / key[:2] / f"{key}{SUFFIX}"

    def read(self, key: str) -> bytes | None:
        """Return the bytes under a key, None when there are none. Raises `OSError` when they cannot be read."""
        try:
            return self.path(key).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None

    def state(self, key: str) -> FileState | None:
        """Return the state of the file of a key, None when there is no file."""
        try:
            found = os.stat(self.path(key))
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns, found.st_size

    def write(self, key: str, data: bytes) -> None:
        """Put `data` under a key. Raises `OSError`; then what was there before is untouched."""
        path = self.path(key)
        if not path.parent.is_dir():
            self._make(path.parent)
        write_whole(path, data, synced=True)

    def set_aside(self, key: str) -> Path | None:
        """Move a record out of the way, to `aside/`. Returns where it is now, None when it could not be moved."""
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
        # A folder that holds other things is somebody's: we must not hide those from git.
        if set(os.listdir(self.folder)) <= _OURS:
            hide_from_git(self.folder)
            if not (self.folder / "CACHEDIR.TAG").exists():
                write_whole(self.folder / "CACHEDIR.TAG", _CACHE_TAG, synced=True)
