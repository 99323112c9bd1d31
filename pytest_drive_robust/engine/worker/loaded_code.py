"""Checks code that a worker loads itself, perhaps hours after the run began: its episodes are stored by that code."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from pytest_drive_robust.errors import UsageError, from_here
from pytest_drive_robust.runner.cache_key.source_files import content_digest


class LoadedCode:
    """Compares the file of each newly loaded module with `sources`: files and their digests when the run began.

    `loaded` names the modules that the fork server had loaded. Those were checked there, and an edit of their files
    changes nothing any more.
    """

    def __init__(self, sources: Mapping[str, str], loaded: Iterable[str]) -> None:
        self._sources = sources
        self._checked = set(loaded)

    def check(self) -> None:
        """Raise `UsageError` for a module that was loaded since the last call from a file that had changed by then."""
        fresh = set(sys.modules) - self._checked
        for name in fresh if self._sources else ():
            named = getattr(sys.modules[name], "__dict__", {}).get("__file__")  # `getattr` would load lazy modules
            file = os.path.realpath(named) if isinstance(named, str) else ""
            if file in self._sources and _digest(Path(file)) != self._sources[file]:
                raise UsageError(
                    f"{from_here(Path(file))} changed after the tests were collected, and a worker process has loaded "
                    "it since. Stored episodes are found by the content of such files. Run again: what is finished is "
                    "kept if the file is as it was."
                )
        self._checked |= fresh


def _digest(file: Path) -> str:
    try:
        return content_digest(file.name, file.read_bytes())
    except OSError:  # it was removed meanwhile
        return ""
