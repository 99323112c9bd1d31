"""Writes files that are either untouched or whole, even when the process dies.

A file is written under a temporary name and renamed. With `synced`, the file is synced before the rename and its folder
after the rename, so that the file outlasts a power cut. Network file systems give the same guarantee: rename is atomic
on the server, and a reader elsewhere sees the old file or the new file (a directory listing may lag behind; opening a
name does not, because that asks the server).
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from pytest_drive_robust.errors import UsageError

_NO_SYNC = frozenset({errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES, errno.EPERM, errno.EISDIR})
"""The error numbers of file systems and operating systems that cannot sync a folder."""
_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)


def write_whole(path: Path, content: str | bytes, *, synced: bool = False) -> None:
    """Write bytes, or text as UTF-8, to `path`; `synced` makes it last through a power cut. Raises `OSError`."""
    rest = memoryview(content.encode() if isinstance(content, str) else content)
    with whole_file(path) as temporary:
        descriptor = os.open(temporary, _FLAGS, 0o666)
        try:
            while rest:
                rest = rest[os.write(descriptor, rest) :]
            if synced:
                os.fsync(descriptor)
        finally:
            os.close(descriptor)
    if synced:
        _sync_folder(path.parent)


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; after the block, rename the file there to `path`.

    When the block raises, the temporary file is removed. If `path` is a link, the target is written and the link stays.
    """
    path = Path(os.path.realpath(path))
    temporary = path.with_name(f".{path.stem}-{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        yield temporary
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


@contextlib.contextmanager
def refusing_unwritable(path: Path) -> Iterator[None]:
    """Raise `UsageError` when the block fails to write `path`, which the user named."""
    try:
        yield
    except OSError as error:
        raise UsageError(f"cannot write {str(path)!r}: {error.strerror or error}.") from error


def make_folder_synced(folder: Path) -> None:
    """Create a folder and its parents, and sync each new name, because a file lasts no longer than its folders."""
    if not folder.is_dir():
        make_folder_synced(folder.parent)
        folder.mkdir(exist_ok=True)
        _sync_folder(folder.parent)


def _sync_folder(folder: Path) -> None:
    """Sync the names in `folder` to disk. Raises `OSError` for a failing disk."""
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
