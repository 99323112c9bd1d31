"""A digest of all code in some folders: the code that an evaluator may import beside the agent's own file.

Only the agent's own Python could tell which modules it imports: agents import by computed names and own paths.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from pytest_drive_robust.bench2drive.results.planned_routes import PLANNED_FILE

_NO_CODE = frozenset({"__pycache__", "site-packages", "node_modules"})
_MARKS = frozenset({"pyvenv.cfg", "conda-meta", PLANNED_FILE})
"""Files that mark a folder as a Python environment, or as a folder of our results, where agents save any files."""


def code_around(folders: Iterable[Path]) -> str:
    """Return a digest (16 hex digits) of the paths and contents of all `*.py` below the folders.

    Python environments, result folders and hidden files and folders are left out. A file is read again only if its
    size, time or inode has changed, because this function is called before every route.
    """
    digest = hashlib.blake2b(digest_size=8)
    for folder in folders:
        for file in _python_files(folder, set()):
            try:
                status = file.stat()
                content = _content(file.path, status.st_size, status.st_mtime_ns, status.st_ino)
            except OSError:  # a file that is gone, or a link to nowhere, which nobody can import
                continue
            digest.update(os.fsencode(file.path) + b"\0" + content)
    return digest.hexdigest()


def _python_files(folder: Path, seen: set[tuple[int, int]]) -> Iterator[os.DirEntry[str]]:
    """Yield the `*.py` below a folder, sorted by name. Links are followed, to each folder once (`seen`)."""
    try:
        status = folder.stat()
        with os.scandir(folder) as found:
            entries = sorted(found, key=lambda entry: entry.name)
    except OSError:  # nothing can be imported from there
        return
    place = status.st_dev, status.st_ino
    is_below = bool(seen)  # a folder that the caller named always counts
    if place in seen or (is_below and not _MARKS.isdisjoint(entry.name for entry in entries)):
        return
    seen.add(place)
    for entry in entries:
        if entry.name.startswith(".") or entry.name in _NO_CODE:
            continue
        if entry.is_dir():
            yield from _python_files(Path(entry.path), seen)
        elif entry.name.endswith(".py"):
            yield entry


@functools.lru_cache(maxsize=1 << 16)
def _content(path: str, size: int, time_ns: int, inode: int) -> bytes:
    """Return the digest of a file, computed again when its size, time or inode has changed."""
    return hashlib.blake2b(Path(path).read_bytes(), digest_size=16).digest()
