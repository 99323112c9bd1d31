"""The folder for routes that are driven with the same setup, and the right to write the files of a route."""

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
    """The paths of the files of a route, below `folder`. Finished routes are in `results`, one file each."""

    folder: Path

    @property
    def results(self) -> Path:
        """The folder of official result files and of files that agents save: an input of `drive-robust score`."""
        return self.folder / "results"

    def result(self, route: str) -> Path:
        """Return the path of a route's official result file, which exists only when the route is scored."""
        return self.results / f"{route}.json"

    def injected(self, route: str) -> Path:
        """Return the path of the log of the injection, one line of JSON."""
        return self.folder / "injected" / f"{route}.jsonl"

    def log(self, route: str, number: int) -> Path:
        """Return the path of the evaluator's output in try `number`."""
        return self.folder / "logs" / f"{route}.{number}.log"

    def work(self, route: str) -> Path:
        """Return the folder for the files of a running try."""
        return self.folder / "work" / route

    def claim(self, name: str, stop: threading.Event) -> Claim | None:
        """Wait until no other command or slot writes a route's files; return the claim, None once `stop` is set."""
        while not stop.is_set():
            claim = Claims(self.folder / "work").attempt(name)
            if claim is not None:
                return claim
            stop.wait(_POLL_S)
        return None

    def plan(self, routes: Iterable[str], stop: threading.Event) -> None:
        """Note that these routes are to be driven: results without one of them are incomplete."""
        claim = self.claim("planned", stop)
        if claim is not None:
            with claim:
                add_planned(self.results, routes)
