"""Finds the snapshot of a reference, which names a stored run, a file or a baseline.

================= ==================================================================
`before`          the stored run of that name
`latest`          the newest stored run, by its recorded date
`runs/x.json`     a file written by `--drive-save`, `--drive-json` or `bless`
`baseline`        the baselines of all agents
`baseline:NAME`   the baseline of one agent
`auto`            `baseline` if there is any baseline, else `latest`
================= ==================================================================
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.options.run import DEFAULT_STORE
from pytest_drive_robust.regression import clock, git
from pytest_drive_robust.regression.baselines import Baseline, blessed_snapshot, checked_baseline, read_baseline
from pytest_drive_robust.regression.document import checked_document, json_text, read_document, snapshot_of
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.store.json_reader import read_json
from pytest_drive_robust.store.record_files import hide_from_git
from pytest_drive_robust.store.whole_file import write_whole

AUTO = "auto"
"""The value of `--drive-save` without a name: the run is named by date, time and commit."""
_RESERVED = (AUTO, "latest", "baseline")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]*")
_STORED = re.compile(r'"stored": \{[^{}]*"date": "([^"]+)"')
_END = 1024
"""The number of bytes at the end of a stored run in which its name, date and commit stand."""


def project_home(start: Path | None = None) -> Path:
    """Return the nearest folder upwards from `start` that has a store or baselines, or `start` when none has.

    `start` defaults to the current folder.
    """
    folder = start or Path.cwd()
    for candidate in (folder, *folder.parents):
        if (candidate / DEFAULT_STORE).is_dir() or (candidate / "suites" / "baselines").is_dir():
            return candidate
    return folder


def project_store() -> Path:
    """Return the default store of the project around the current folder; run options may name another store."""
    return project_home() / DEFAULT_STORE


def check_run_name(name: str, *, source: str) -> str:
    """Return `name` if it is a valid file name and no reserved word. Raises `UsageError`, naming `source`.

    A path is refused with advice, because `--drive-save suites/` swallows the folder that was meant to be collected.
    """
    if name in _RESERVED:
        raise UsageError(f"{source} is {name!r}, which is a reserved word. Choose another name.")
    if not _NAME.fullmatch(name) or name.endswith((".json", ".py")):
        raise UsageError(
            f"{source} is {name!r}, expected a name of letters, digits and . _ + -, as in {source}=before. "
            f"If it was meant as a path to collect, put it before {source}."
        )
    return name


class StoredRuns:
    """The stored runs below `home`. The first `save` creates the folder."""

    def __init__(self, home: Path) -> None:
        self._home = home

    @property
    def path(self) -> Path:
        """The folder of the stored runs."""
        return self._home / DEFAULT_STORE / "runs"

    def save(self, document: Mapping[str, Any], *, name: str) -> Path:
        """Store a run under `name`, with date and commit, and return its path. `AUTO` makes a name.

        A stored run of equal name is replaced. The file appears only when it is complete.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        hide_from_git(self._home / DEFAULT_STORE)  # people commit baselines, not stored runs
        now, commit = clock.now(), git.commit(self._home)
        if name == AUTO:
            name = self._free(f"{now:%Y-%m-%d_%H-%M-%S}" + (f"_{commit}" if commit else ""))
        path = self.path / f"{name}.json"
        stored = {"name": name, "date": now.isoformat(), "commit": commit or None}
        write_whole(path, json_text({**document, "stored": stored}))
        return path

    def names(self) -> list[str]:
        """Return the names of all stored runs, the oldest first; a link that leads nowhere is none."""
        return [path.stem for path in sorted(filter(Path.is_file, self.path.glob("*.json")), key=_age)]

    def find(self, name: str) -> Path:
        """Return the file of a stored run; `"latest"` is the newest run. Raises `UnknownNameError`."""
        names = self.names()
        if name == "latest" and names:
            name = names[-1]
        if name not in names:
            hint = f"Store one with --drive-save=NAME. Looked in {str(self.path)!r}."
            raise UnknownNameError.of("stored run", name, names, hint=hint, listed_by="drive-robust runs list")
        return self.path / f"{name}.json"

    def _free(self, name: str) -> str:
        """Return `name`, with a number appended if two runs end in the same second."""
        number, free = 1, name
        while (self.path / f"{free}.json").exists():
            number, free = number + 1, f"{name}_{number + 1}"
        return free


def _age(path: Path) -> tuple[float, int, str]:
    """Return a sort key by the age of a stored run: the recorded date, or the file's time when no date is found.

    The file's time alone is not enough, because copies and artifact downloads are all new. The recorded date stands at
    the end of the file (see `save`).
    """
    status = path.stat()
    try:
        with path.open("rb") as file:
            file.seek(max(0, status.st_size - _END))
            told = _STORED.search(file.read().decode("utf-8", errors="replace"))
        when_s = datetime.fromisoformat(told[1]).timestamp() if told else float(status.st_mtime_ns // 10**9)
    except (OSError, ValueError):
        when_s = float(status.st_mtime_ns // 10**9)
    return when_s, status.st_mtime_ns, path.name


def names_file(reference: str, start: Path = Path()) -> bool:
    """Return True for a path, which starts from the folder `start`; False for the name of a stored run."""
    path = Path(reference)
    return path.suffix == ".json" or "/" in reference or len(path.parts) > 1 or (start / path).is_file()


def run_file(runs: StoredRuns, reference: str) -> Path:
    """Return the file of a reference: a path, or the stored run of that name. Raises `UnknownNameError`."""
    return Path(reference) if names_file(reference) else runs.find(reference)


def read_run_document(reference: str) -> dict[str, Any]:
    """Return the document of a stored run, of `"latest"` or of a JSON file. Raises `UsageError`.

    Stored runs are those of the project around the current folder.
    """
    return read_document(run_file(StoredRuns(project_home()), reference))


BASELINES = Path("suites", "baselines")
"""The default folder of baselines, below the home of a project."""
_BASELINE = "baseline"


class References:
    """Finds runs below `home` and baselines in the folder `baselines`."""

    def __init__(self, home: Path, baselines: Path | None = None) -> None:
        self.runs = StoredRuns(home)
        self.baselines = home / BASELINES if baselines is None else baselines

    def load(self, reference: str, *, simulator: str | None = None) -> Snapshot:
        """Return the snapshot of a reference; `simulator` selects the scores of a baseline.

        Raises `UsageError` for a run or baseline that is missing or cannot be read.
        """
        word, _, agent = reference.partition(":")
        if reference == AUTO:
            return self._auto(simulator)
        if word == _BASELINE:
            return self._blessed(agent, simulator)
        path = run_file(self.runs, reference)
        return self._file(path, simulator) if path == Path(reference) else self.stored(path.stem)

    def is_same_file(self, reference: str, other: str) -> bool:
        """Return True when both references name the file of one run; False for `auto` and baselines."""
        if any(name == AUTO or name.partition(":")[0] == _BASELINE for name in (reference, other)):
            return False
        return run_file(self.runs, reference).resolve() == run_file(self.runs, other).resolve()

    def takes(self, reference: str, path: Path) -> bool:
        """Return True when a reference stands for the stored run in `path`, an existing file."""
        reference = self._meant(reference)
        return reference.partition(":")[0] != _BASELINE and run_file(self.runs, reference).resolve() == path.resolve()

    def load_run(self, reference: str) -> Snapshot:
        """Return the snapshot of a whole run, as `load` does. Raises `UsageError` also for a baseline."""
        if reference == AUTO:
            raise _no_run(reference, "may stand for a baseline")
        if reference.partition(":")[0] == _BASELINE:
            raise _no_run(reference, "is a baseline")
        path = run_file(self.runs, reference)
        if path != Path(reference):
            return self.stored(path.stem)
        found = _run_or_baseline(path)
        if isinstance(found, Baseline):
            raise _no_run(reference, "is a baseline")
        return snapshot_of(found, label=str(path))

    def document(self, reference: str) -> dict[str, Any] | None:
        """Return the whole document of a reference, or None for a baseline or a run that cannot be read."""
        reference = self._meant(reference)
        if reference.partition(":")[0] == _BASELINE:
            return None
        try:
            found = _run_or_baseline(run_file(self.runs, reference))
        except UsageError:
            return None
        return None if isinstance(found, Baseline) else found

    def stored(self, name: str) -> Snapshot:
        """Return the snapshot of a stored run. Raises `UsageError` when there is none or it cannot be read."""
        path = self.runs.find(name)
        return snapshot_of(read_document(path), label=path.stem)

    def _meant(self, reference: str) -> str:
        """Return `baseline` or `latest` for `auto`, and any other reference unchanged."""
        if reference != AUTO:
            return reference
        return _BASELINE if any(self.baselines.glob("*.json")) else "latest"

    def _auto(self, simulator: str | None) -> Snapshot:
        if self._meant(AUTO) == _BASELINE:
            return self._blessed("", simulator)
        if not self.runs.names():
            raise UsageError(
                f"there is nothing to compare with: no baseline in {str(self.baselines)!r} and no stored run. "
                "Store one with --drive-save."
            )
        return self.stored("latest")

    def _blessed(self, agent: str, simulator: str | None) -> Snapshot:
        found = [read_baseline(path) for path in sorted(self.baselines.glob("*.json"))]
        if agent:
            known = [baseline.agent for baseline in found]
            if agent not in known:
                raise UnknownNameError.of("baseline of an agent", agent, known, hint="`drive-robust bless` writes one.")
            found = [baseline for baseline in found if baseline.agent == agent]
        if not found:
            raise UsageError(
                f"no baseline was blessed yet: {str(self.baselines)!r} holds none. Write one with `drive-robust bless`."
            )
        return blessed_snapshot(found, simulator=simulator, label=f"{_BASELINE}:{agent}" if agent else _BASELINE)

    def _file(self, path: Path, simulator: str | None) -> Snapshot:
        found = _run_or_baseline(path)
        if isinstance(found, Baseline):
            return blessed_snapshot([found], simulator=simulator, label=str(path))
        return snapshot_of(found, label=str(path))


def _run_or_baseline(path: Path) -> dict[str, Any] | Baseline:
    """Return what a file holds. Raises `UsageError` for a file that is missing or holds neither."""
    if not path.is_file():
        beside = [str(near) for near in path.parent.glob("*.json")]
        raise UnknownNameError.of("run file", str(path), beside)
    document = read_json(path, name=f"the file {str(path)!r}")
    if isinstance(document, dict) and "blessings" in document:
        return checked_baseline(document, path)
    return checked_document(document, path)


def _no_run(reference: str, what: str) -> UsageError:
    return UsageError(f"{reference!r} {what}, expected a run. `drive-robust runs list` shows the runs.")
