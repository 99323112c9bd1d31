"""What an agent and a set of routes are made of, as digests: told once per scope, compared by `fingerprint`."""

from __future__ import annotations

import hashlib
import inspect
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.events import Identified

if TYPE_CHECKING:
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.registry import Registry
    from pytest_drive_robust.runner.plan import Scope

__all__ = ["identify", "route_digest", "source_digest", "weights_digest"]

_BLOCK_BYTES = 1 << 20


def identify(scope: Scope, registry: Registry) -> Identified:
    """The agent and the routes of `scope`. Raises `UsageError` for weights that cannot be read."""
    entry = registry.entry("agents", scope.agent)
    factory = entry.load()
    return Identified(
        agent=scope.agent,
        distribution=entry.origin,
        source=source_digest(factory),
        weights=weights_digest(getattr(factory, "weights", ()), agent=scope.agent),
        routes=tuple(f"{route.id}={route_digest(route)}" for route in scope.routes),
    )


def route_digest(route: Route) -> str:
    """12 hex digits of everything that the route says."""
    return _hex(repr(route).encode())


def source_digest(factory: object) -> str:
    """12 hex digits of the code behind an agent's factory; empty when its file is not known.

    That is every Python file of the top-level package that defines it, or the one file where there is no package.
    """
    try:
        file = Path(inspect.getfile(inspect.unwrap(factory))).resolve()  # type: ignore[arg-type]
    except (OSError, TypeError):
        return ""
    package = sys.modules.get(str(getattr(factory, "__module__", "")).partition(".")[0])
    folders = [Path(folder).resolve() for folder in getattr(package, "__path__", ())]
    folder = next((folder for folder in folders if file.is_relative_to(folder)), None)
    files = [file] if folder is None else sorted(folder.rglob("*.py"))
    digest = hashlib.blake2b(digest_size=6)
    for path in files:
        if path.is_file():
            name = path.name if folder is None else path.relative_to(folder).as_posix()
            digest.update(name.encode() + b"\0" + _hex(path.read_bytes()).encode())
    return digest.hexdigest()


def weights_digest(files: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], *, agent: str) -> str:
    """12 hex digits of the content of an agent's weight files, in their order; empty when it names none.

    Raises `UsageError` when a file cannot be read.
    """
    several: Iterable[str | os.PathLike[str]] = [files] if isinstance(files, (str, os.PathLike)) else files
    digest, found = hashlib.blake2b(digest_size=6), False
    for path in map(Path, several):
        found = True
        try:
            with path.open("rb") as file:
                while block := file.read(_BLOCK_BYTES):
                    digest.update(block)
        except OSError as error:
            raise UsageError(
                f"the agent {agent!r} names the weights {str(path)!r}, which cannot be read: {error.strerror}."
            ) from None
    return digest.hexdigest() if found else ""


def _hex(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=6).hexdigest()
