"""A folder of records, one file for each key: `episodes/ab/abcdef.episode`. The files are the only truth of the store.

A file appears whole or not at all: it is written under another name, synced, renamed, and then its folder is synced.
That holds on network file systems, too: rename is atomic on the server, and a reader elsewhere sees the old state or
the new one (a directory listing may lag behind; opening a name does not, because that asks the server).
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

__all__ = ["Shelf", "write_synced"]

_NO_SYNC = frozenset({errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES, errno.EPERM, errno.EISDIR})
"""What file systems and systems that cannot sync a folder say."""


_CACHE_TAG = (
    b"Signature: 8a477f597d28d172789f06886806bc55\n# Episodes that pytest-drive-robust drove: safe to delete.\n"
)
"""By this first line backup programs know a cache (bford.info/cachedir)."""

_OURS = frozenset({"episodes", "claims", "aside", "runs", "index.sqlite", ".gitignore", "CACHEDIR.TAG"})


class Shelf:
    """The records below `folder`, which is made when the first one is written."""

    SUFFIX = ".episode"

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._episodes = folder / "episodes"

    def path(self, key: str) -> Path:
        """Where the record of a key is, or would be."""
        return self._episodes / key[:2] / f"{key}{self.SUFFIX}"

    def read(self, key: str) -> bytes | None:
        """The bytes under a key, None when there are none. Raises `OSError` when they cannot be read."""
        try:
            with open(self.path(key), "rb") as file:
                return file.read()
        except (FileNotFoundError, NotADirectoryError):
            return None

    def state(self, key: str) -> tuple[int, int, int] | None:
        """What changes when the file is replaced: (inode, time of change, size). None when there is no file."""
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
        write_synced(path, data)

    def set_aside(self, key: str) -> Path | None:
        """Move a record out of the way, to `aside/`. Where it is now, None when it could not be moved."""
        path = self.path(key)
        aside = self.folder / "aside"
        number = 1
        target = aside / path.name
        try:
            aside.mkdir(parents=True, exist_ok=True)
            while target.exists():
                number += 1
                target = aside / f"{key}.{number}{self.SUFFIX}"
            os.replace(path, target)
        except OSError:
            return None
        return target

    def all_keys(self) -> Iterator[str]:
        """Every key that has a record, sorted within each of the 256 folders."""
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            for shard in sorted(os.listdir(self._episodes)):
                with contextlib.suppress(FileNotFoundError, NotADirectoryError):
                    names = sorted(os.listdir(self._episodes / shard))
                    yield from (name.removesuffix(self.SUFFIX) for name in names if name.endswith(self.SUFFIX))

    def _make(self, shard: Path) -> None:
        _make_synced(shard)
        # A folder that holds other things is somebody's: we must not hide those from git.
        if set(os.listdir(self.folder)) <= _OURS:
            for name, content in ((".gitignore", b"*\n"), ("CACHEDIR.TAG", _CACHE_TAG)):
                if not (self.folder / name).exists():
                    write_synced(self.folder / name, content)


def write_synced(path: Path, data: bytes) -> None:
    """Write a file that is either untouched or whole, also after a power cut. Raises `OSError`."""
    temporary = path.with_name(f".{path.stem}-{os.getpid()}-{secrets.token_hex(4)}.tmp")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
    descriptor = os.open(temporary, flags, 0o666)
    try:
        try:
            rest = memoryview(data)
            while rest:
                rest = rest[os.write(descriptor, rest) :]
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
    _sync_folder(path.parent)


def _make_synced(folder: Path) -> None:
    """Make a folder with those above it, and each of their names last: a file in it lasts no longer than they do."""
    if not folder.is_dir():
        _make_synced(folder.parent)
        folder.mkdir(exist_ok=True)
        _sync_folder(folder.parent)


def _sync_folder(folder: Path) -> None:
    """Make the names in `folder` last. Raises `OSError` for a disk that fails."""
    if os.name == "nt":
        return  # a folder cannot be opened there
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        if error.errno in _NO_SYNC:
            return
        raise
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise
    finally:
        os.close(descriptor)
