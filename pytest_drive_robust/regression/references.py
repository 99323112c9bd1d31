"""From what people type to a snapshot: a stored run, a file, or what was blessed.

================= ==================================================================
`before`          the stored run of that name
`latest`          the newest stored run
`runs/x.json`     a file written by `--drive-save`, `--drive-json` or `bless`
`baseline`        everything that was blessed, of all agents
`baseline:NAME`   what was blessed of one agent
`auto`            `baseline` where something was blessed, else `latest`
================= ==================================================================
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.regression.baselines import read_baseline
from pytest_drive_robust.regression.blessing import blessed_snapshot
from pytest_drive_robust.regression.document import read_document, snapshot_of
from pytest_drive_robust.regression.runs import AUTO, StoredRuns, run_file
from pytest_drive_robust.regression.snapshot import Snapshot

BASELINES = Path("suites", "baselines")
"""Where baselines are, below the home of a project."""
_BASELINE = "baseline"


class References:
    """Finds runs below `home`; `baselines` is the folder of the blessed ones."""

    def __init__(self, home: Path, baselines: Path | None = None) -> None:
        self.runs = StoredRuns(home)
        self.baselines = home / BASELINES if baselines is None else baselines

    def load(self, reference: str, *, simulator: str | None = None) -> Snapshot:
        """Return the snapshot of a reference. `simulator` says which scores of a baseline are meant.

        Raises `UsageError` for what is not there or cannot be read.
        """
        word, _, agent = reference.partition(":")
        if reference == AUTO:
            return self._auto(simulator)
        if word == _BASELINE:
            return self._blessed(agent, simulator)
        path = Path(reference)
        if path.suffix == ".json" or path.is_file() or len(path.parts) > 1:
            return self._file(path, simulator)
        return self.stored(reference)

    def load_run(self, reference: str) -> Snapshot:
        """Load as `load` does, whole runs only. Raises `UsageError` for a baseline too."""
        path = Path(reference)
        if reference.partition(":")[0] == _BASELINE or (path.is_file() and _is_baseline(path)):
            raise UsageError(f"{reference!r} is a baseline, expected a run. `drive-robust runs list` shows them.")
        return self.load(reference)

    def document(self, reference: str) -> dict[str, Any] | None:
        """Return the whole document behind a reference; None where it is a baseline, or is not there any more."""
        word = reference.partition(":")[0]
        if word == AUTO:
            if any(self.baselines.glob("*.json")):
                return None
            reference = "latest"
        if word == _BASELINE:
            return None
        try:
            path = run_file(self.runs, reference)
            return None if _is_baseline(path) else read_document(path)
        except UsageError:
            return None

    def stored(self, name: str) -> Snapshot:
        """Return the stored run of a name. Raises `UsageError`."""
        path = self.runs.find(name)
        return snapshot_of(read_document(path), label=path.stem)

    def _auto(self, simulator: str | None) -> Snapshot:
        if any(self.baselines.glob("*.json")):
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
            raise UsageError(f"no baseline was blessed yet: {str(self.baselines)!r} holds none.")
        return blessed_snapshot(found, simulator=simulator, label=f"{_BASELINE}:{agent}" if agent else _BASELINE)

    def _file(self, path: Path, simulator: str | None) -> Snapshot:
        if not path.is_file():
            beside = [str(near) for near in path.parent.glob("*.json")]
            raise UnknownNameError.of("run file", str(path), beside)
        if _is_baseline(path):
            return blessed_snapshot([read_baseline(path)], simulator=simulator, label=str(path))
        return snapshot_of(read_document(path), label=str(path))


def _is_baseline(path: Path) -> bool:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False  # read_document says what is wrong with it
    return isinstance(document, dict) and "blessings" in document
