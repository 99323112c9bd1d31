"""The weight files that an agent's factory names: their content, for keys, and their states, to notice a change."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.agent_factories import paths_named
from pytest_drive_robust.runner.cache_key.digests import add_file
from pytest_drive_robust.runner.cache_key.source_files import is_hidden

FileStates = tuple[tuple[str, int, int], ...]
"""(name, time of change in ns, size in bytes) of each file."""


def weights_digest(factory: object, *, agent: str) -> str:
    """Return a digest of the content of an agent's weight files, in order, 12 hex digits; `""` without files.

    The factory's attribute `weights` is a path, a list of paths, or None. All files of a folder count, with their
    names. Raises `UsageError` when `weights` is anything else, and when a file cannot be read.
    """
    named = paths_named(factory)
    if not all(isinstance(file, (str, os.PathLike)) for file in named):
        given: Any = getattr(factory, "weights", None)
        raise UsageError(
            f"`weights` of the agent {agent!r} is {given!r}, expected the paths of its weight files, known before it "
            "is made. Name what else it is otherwise."
        )
    paths = [Path(file) for file in named]
    digest = hashlib.blake2b(digest_size=6)
    try:
        for path in paths:
            for name, file in _files_of(path):
                digest.update(os.fsencode(f"\0{name}\0") if name else b"")
                add_file(digest, file)
    except OSError as error:
        raise UsageError(
            f"the agent {agent!r} names the weights {str(path)!r}, which cannot be read: {error.strerror}."
        ) from None
    return digest.hexdigest() if paths else ""


def states_of_weights(factory: object) -> FileStates:
    """Return the state of each file that a factory names in `weights`."""
    states = []
    for path in paths_named(factory):
        with suppress(OSError, TypeError, ValueError):  # the code that reads the file reports it
            for name, file in _files_of(path):
                found = os.stat(file)
                states.append((name, found.st_mtime_ns, found.st_size))
    return tuple(states)


def _files_of(path: str | Path) -> Iterator[tuple[str, Path]]:
    """Yield (name, path) of the files of a folder, with names relative to it; `("", path)` when `path` is a file.

    Files come in the order of their names. Hidden files are left out. Links are followed, and each folder is read once.
    Raises `OSError`.
    """
    if not os.path.isdir(path):
        yield "", Path(path)
        return
    seen = set()
    for place, folders, names in os.walk(path, followlinks=True, onerror=_raise):
        real = os.path.realpath(place)
        folders[:] = [] if real in seen else sorted(name for name in folders if not is_hidden(name))
        if real not in seen:
            seen.add(real)
            for name in sorted(name for name in names if not is_hidden(name)):
                file = Path(place, name)
                yield file.relative_to(path).as_posix(), file


def _raise(error: OSError) -> None:
    raise error
