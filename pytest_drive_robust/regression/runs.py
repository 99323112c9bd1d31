"""Stored runs: `.drive-robust/runs/NAME.json`, each a whole run as one document."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.regression import clock, git
from pytest_drive_robust.store.whole_file import write_whole

AUTO = "auto"
"""What `--drive-save` alone stands for: a name of the date, the time and the commit."""
_RESERVED = (AUTO, "latest", "baseline")
_HOME = ".drive-robust"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]*")


def home_of(folder: Path) -> Path:
    """Return the nearest folder upwards that has stored runs or blessed baselines; `folder` itself where none has."""
    for candidate in (folder, *folder.parents):
        if (candidate / _HOME).is_dir() or (candidate / "suites" / "baselines").is_dir():
            return candidate
    return folder


def check_run_name(name: str, *, source: str) -> str:
    """Return the name when a file can be called so and nothing else is. Raises `UsageError`, naming `source`.

    A path is refused with advice: `--drive-save suites/` takes the folder that was meant to be collected.
    """
    if name in _RESERVED:
        raise UsageError(f"{source} is {name!r}, which stands for something else. Choose another name.")
    if not _NAME.fullmatch(name) or name.endswith((".json", ".py")):
        raise UsageError(
            f"{source} is {name!r}, expected a name of letters, digits and . _ + -, as in {source}=before. "
            f"If it was meant as a path to collect, put it before {source}."
        )
    return name


class StoredRuns:
    """The stored runs below `home`. Nothing is created before something is stored."""

    def __init__(self, home: Path) -> None:
        self._home = home

    @property
    def path(self) -> Path:
        """Where the files are."""
        return self._home / _HOME / "runs"

    def save(self, document: Mapping[str, Any], text_of: Any, *, name: str) -> Path:
        """Store a run under `name` (`AUTO` makes one up) with date and commit. One of that name is replaced whole.

        `text_of` turns a document into text. The file appears when it is complete.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        self._hide_from_git()
        now, commit = clock.now(), git.commit(self._home)
        if name == AUTO:
            name = self._free(f"{now:%Y-%m-%d_%H-%M-%S}" + (f"_{commit}" if commit else ""))
        path = self.path / f"{name}.json"
        stored = {"name": name, "date": now.isoformat(), "commit": commit or None}
        write_whole(path, text_of({**document, "stored": stored}))
        return path

    def names(self) -> list[str]:
        """Return every stored run, the oldest first."""
        paths = sorted(self.path.glob("*.json"), key=lambda path: (path.stat().st_mtime_ns, path.name))
        return [path.stem for path in paths]

    def find(self, name: str) -> Path:
        """Return the file of a run; `"latest"` is the newest. Raises `UnknownNameError`."""
        names = self.names()
        if name == "latest" and names:
            name = names[-1]
        if name not in names:
            raise UnknownNameError.of("stored run", name, names, hint="Store one with --drive-save=NAME.")
        return self.path / f"{name}.json"

    def _free(self, name: str) -> str:
        """Return `name`, or with a number behind it when two runs end in the same second."""
        number, free = 1, name
        while (self.path / f"{free}.json").exists():
            number, free = number + 1, f"{name}_{number + 1}"
        return free

    def _hide_from_git(self) -> None:
        """Keep stored runs out of git: they are large and belong to one machine. Baselines are what is committed."""
        ignore = self._home / _HOME / ".gitignore"
        if not ignore.exists():
            write_whole(ignore, "*\n")


def run_file(runs: StoredRuns, reference: str) -> Path:
    """Return the file that people mean: a path, else the stored run of that name. Raises `UnknownNameError`."""
    path = Path(reference)
    if path.suffix == ".json" or path.is_file() or len(path.parts) > 1:
        return path
    return runs.find(reference)
