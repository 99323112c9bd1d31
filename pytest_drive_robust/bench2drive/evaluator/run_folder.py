"""Where the files of routes go that are driven alike, and who may write those of a route."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.results.planned_routes import add_planned
from pytest_drive_robust.store.claims import Claim, Claims

_POLL_S = 0.2


@dataclass(frozen=True, slots=True)
class RunFolder:
    """Where the files of a route go, below `folder`. What is finished is in `results`, one file for each route."""

    folder: Path

    @property
    def results(self) -> Path:
        """Official result files, and beside them what agents save: what `drive-robust score` takes."""
        return self.folder / "results"

    def result(self, route: str) -> Path:
        """Return the official result file of a route; there only when it is scored."""
        return self.results / f"{route}.json"

    def injected(self, route: str) -> Path:
        """Return one line of JSON: what was injected."""
        return self.folder / "injected" / f"{route}.jsonl"

    def log(self, route: str, number: int) -> Path:
        """Return what the evaluator said in try `number`."""
        return self.folder / "logs" / f"{route}.{number}.log"

    def work(self, route: str) -> Path:
        """Return what a try writes before it is known to be a result."""
        return self.folder / "work" / route

    def claim(self, name: str, stop: threading.Event) -> Claim | None:
        """Wait until no other command and no other slot writes what belongs to a route; None once `stop` is set."""
        while not stop.is_set():
            claim = Claims(self.folder / "work").attempt(name)
            if claim is not None:
                return claim
            stop.wait(_POLL_S)
        return None

    def plan(self, routes: Iterable[str], stop: threading.Event) -> None:
        """Note that these routes are to be driven: results without them are not whole."""
        claim = self.claim("planned", stop)
        if claim is not None:
            with claim:
                add_planned(self.results, routes)
