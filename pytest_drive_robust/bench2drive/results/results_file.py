"""Read official result files: a file of the evaluator, a folder of splits, or a file of the official merge tool."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord, read_record
from pytest_drive_robust.bench2drive.results.planned_routes import planned_routes
from pytest_drive_robust.bench2drive.results.safe_json import finite, is_empty, printable, read_json
from pytest_drive_robust.errors import UsageError, first_few

_MERGED = "merged.json"
_MOST_SHOWN = 10


@dataclass(frozen=True, slots=True)
class UnfinishedFile:
    """A file with fewer episodes than the evaluator planned; `planned` is None for an empty file.

    For results that our own runs drove, `path` is the folder of the files. Only then `missing` has the missing routes.
    """

    path: Path
    held: int
    planned: int | None
    doubled: int = 0
    """The number of further records of episodes that the file holds already."""
    missing: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.planned is None:
            return f"{printable(self.path)} is empty: its evaluator ended before the first route"
        names = first_few([printable(name, quotes=False) for name in self.missing], _MOST_SHOWN)
        without = f", without {names}" if self.missing else ""
        doubled = f", and {self.doubled} more records of the same ones" if self.doubled else ""
        return f"{printable(self.path)} holds {self.held} of {self.planned} episodes{without}{doubled}"


@dataclass(frozen=True, slots=True)
class ResultSet:
    """The records of one run in the order of their files and lines.

    `planned` is the number of episodes (routes times repetitions) that the evaluator planned, None if a file does not
    tell it; `unfinished` are the files that hold fewer episodes than planned, or are empty. `missing` are the planned
    routes without a record, where a list of planned routes exists. `folder` holds the files; folders of single routes
    are looked for from there. `skipped` are files without records.
    """

    records: tuple[OfficialRecord, ...]
    folder: Path
    planned: int | None = None
    skipped: tuple[Path, ...] = ()
    unfinished: tuple[UnfinishedFile, ...] = ()
    missing: tuple[str, ...] = ()

    @property
    def duplicates(self) -> tuple[str, ...]:
        """The route ids (with repetition) that several records share."""
        counts = Counter(record.route_id for record in self.records)
        return tuple(route_id for route_id, count in counts.items() if count > 1)


def read_results(path: Path) -> ResultSet:
    """Return the results in a file or in the `*.json` of a folder; `merged.json` in it is read only without splits.

    Raises `UsageError` for a path that is missing, damaged, or holds no record.
    """
    single = _is_file(path)
    files = [path] if single else _files_of(path)
    routes = () if single else planned_routes(path)
    records: list[OfficialRecord] = []
    planned: list[int | None] = []
    skipped: list[Path] = []
    unfinished: list[UnfinishedFile] = []
    for file in files:
        if file != path and is_empty(file):
            skipped.append(file)
            if not routes:  # our runs leave only whole files: among these, an empty file is the agent's
                unfinished.append(UnfinishedFile(file, 0, None))
            continue
        document = read_json(file)
        lines = _records_of(document)
        if lines is None:
            if file == path:
                raise UsageError(f"{printable(file)} holds no official results: expected '_checkpoint' with 'records'.")
            skipped.append(file)
            continue
        of_file = [read_record(line, f"{printable(file)}, record {number}") for number, line in enumerate(lines)]
        held, total = len({record.route_id for record in of_file}), _planned(document)
        if total is not None and held < total:
            unfinished.append(UnfinishedFile(file, held, total, doubled=len(of_file) - held))
        records += of_file
        planned.append(total)
    if not records:
        raise UsageError(f"{printable(path)} holds no record of a route. A score of nothing is not 0.")
    totals = [total for total in planned if total is not None]
    there = {record.route for record in records}
    missing = tuple(route for route in routes if route not in there)
    if missing:
        unfinished.append(UnfinishedFile(path, len(routes) - len(missing), len(routes), missing=missing))
    return ResultSet(
        records=tuple(records),
        folder=path.parent if single else path,
        # a file that does not tell its plan leaves the whole number unknown
        planned=sum(totals) + len(missing) if routes or len(totals) == len(files) else None,
        skipped=tuple(skipped),
        unfinished=tuple(unfinished),
        missing=missing,
    )


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError) as error:  # a name that no disk can have
        raise UsageError(f"{printable(path)} cannot be read: {getattr(error, 'strerror', None) or error}.") from None


def _files_of(folder: Path) -> list[Path]:
    """Return the files that the official merge tool would take, sorted by name. Raises `UsageError` without any."""
    try:
        found = sorted(item for item in folder.iterdir() if item.suffix == ".json" and not item.name.startswith("."))
        splits = [item for item in found if _MERGED not in item.name]
        if splits or found:
            holding = (not is_empty(item) and _records_of(read_json(item)) is not None for item in splits)
            return splits if any(holding) else found
        below = sorted({printable(item.parent) for item in folder.glob("*/*.json")})[:5]
    except OSError as error:
        raise UsageError(f"{printable(folder)} cannot be read: {error.strerror}.") from None
    hint = f" Below it, files are in {', '.join(below)}." if below else ""
    raise UsageError(f"{printable(folder)} holds no *.json file.{hint} Give a result file or the folder of its parts.")


def _records_of(document: object) -> list[object] | None:
    checkpoint = document.get("_checkpoint") if isinstance(document, dict) else None
    records = checkpoint.get("records") if isinstance(checkpoint, dict) else None
    return records if isinstance(records, list) else None


def _planned(document: object) -> int | None:
    """Return the planned number of episodes, from `progress`: [done, planned]; None if it is not told."""
    assert isinstance(document, dict)  # it has records
    progress = document["_checkpoint"].get("progress")
    if not isinstance(progress, list) or len(progress) != 2:
        return None
    total = finite(progress[1])
    return int(total) if total is not None and total >= 0.0 and total == int(total) else None
