"""Digests of the files that the class of a perturbation, or a world, names in `files`."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.cache_key.digests import add_file


def file_digests(owner: object) -> list[str]:
    """Return the digest of each file that a perturbation's class or a world names in `files`. Raises `UsageError`."""
    fields = dataclasses.fields(owner) if dataclasses.is_dataclass(owner) else ()
    if "files" in {field.name for field in fields}:
        return []  # a severity named `files`
    named = getattr(owner, "files", ())
    if not isinstance(named, (list, tuple)) or not all(isinstance(file, (str, os.PathLike)) for file in named):
        raise UsageError(f"`files` of {_called(owner)} is {named!r}, expected the paths of the files that it reads.")
    return [_file_digest(file, owner) for file in named]


def _file_digest(file: str | os.PathLike[str], owner: object) -> str:
    try:
        status = os.stat(file)
        return _content_digest(os.path.abspath(file), status.st_mtime_ns, status.st_size)
    except OSError as error:
        told = f"{_called(owner)} names the file {os.fspath(file)!r}, which cannot be read: {error.strerror}."
        raise UsageError(told) from None


def _called(owner: object) -> str:
    return (owner if isinstance(owner, type) else type(owner)).__name__


@functools.cache
def _content_digest(path: str, _changed_ns: int, _size_bytes: int) -> str:
    digest = hashlib.blake2b(digest_size=16)
    add_file(digest, path)
    return digest.hexdigest()
