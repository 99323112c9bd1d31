"""Journals of a run: each worker appends its events to a file that the controller and the other workers read."""

from __future__ import annotations

import contextlib
from pathlib import Path

from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.store.events import Event, event_from_json, event_to_json


class JournalWriter:
    """Appends the events of one process to a file, unbuffered, so that no event is lost when the process dies."""

    def __init__(self, folder: Path, *, name: str) -> None:
        journals = folder / "journals"
        journals.mkdir(parents=True, exist_ok=True)
        self._path = journals / f"{name}.jsonl"
        self._file = self._path.open("ab", buffering=0)
        self._cut = self._file.tell() > 0

    def __call__(self, event: Event) -> None:
        """Append one event on its own line, even after a line that was cut off. Raises `DriveRobustError`."""
        rest = memoryview(b"\n" * self._cut + event_to_json(event).encode() + b"\n")
        self._cut = True
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            raise DriveRobustError(
                f"what this worker does cannot be written to {self._path}, where the run reads it: "
                f"{error.strerror or error}. Make room there, or let TMPDIR name a folder with room, and run again: "
                "finished episodes are kept."
            ) from error
        self._cut = False

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class JournalReader:
    """Reads the events that all processes of a run have written since the last `read`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "journals"
        self._positions: dict[Path, int] = {}

    def read(self) -> list[Event]:
        """Return the new events, in order within each process. Skips a line that a dying writer cut off."""
        events: list[Event] = []
        for path in sorted(self._folder.glob("*.jsonl")):
            with path.open("rb") as file:
                file.seek(self._positions.get(path, 0))
                fresh = file.read()
            whole, newline, _ = fresh.rpartition(b"\n")
            self._positions[path] = self._positions.get(path, 0) + len(whole) + len(newline)
            for line in whole.splitlines():
                with contextlib.suppress(ValueError):
                    events.append(event_from_json(line.decode()))
        return events
