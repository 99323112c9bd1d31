"""`drive-robust report`: a stored run as a folder of pages."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.cli.compare import add_baselines, references_of
from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import DEFAULT_STORE
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.document import read_document, snapshot_of
from pytest_drive_robust.regression.outcome import Terms
from pytest_drive_robust.regression.runs import StoredRuns, home_of, run_file
from pytest_drive_robust.report.pages.folder import check_folder, write_pages
from pytest_drive_robust.report.pages.records import RunRecords
from pytest_drive_robust.store.record import decode_record
from pytest_drive_robust.store.record_files import RecordFiles

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["add_arguments"]

_DESCRIPTION = """Writes a run as a folder of pages: verdicts, evidence, failures, replays, what changed against another
run. Open its index.html; it needs no network and no server. The episodes come from the store; those that are not there
are listed, but cannot be replayed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `report`."""
    parser.description = _DESCRIPTION
    parser.add_argument("run", metavar="RUN", help="a stored run, latest, or the JSON file of a run")
    parser.add_argument("--against", metavar="BASE", help="compare with: a run, or baseline or baseline:AGENT")
    parser.add_argument("--out", metavar="DIR", default="drive-report", help="a folder; default: drive-report")
    parser.add_argument("--store", metavar="FOLDER", help="where the episodes are; default: .drive-robust")
    parser.add_argument("--films", metavar="FOLDER", help="the videos that drive-robust replay wrote there")
    add_baselines(parser)
    parser.set_defaults(command=_report)


def _report(options: argparse.Namespace) -> int:
    folder = Path(options.out)
    check_folder(folder, source="--out")
    home, registry = home_of(Path.cwd()), default_registry()
    find = _finder(Path(options.store) if options.store else home / DEFAULT_STORE)
    document = read_document(run_file(StoredRuns(home), options.run))
    label = _label(document, options.run)
    records = RunRecords.of(document, find, registry, label=label)
    comparison = before = None
    if options.against:
        after = snapshot_of(document, label=label)
        references = references_of(options)
        snapshot = references.load(options.against, simulator=after.simulator)
        comparison = compare(snapshot, after, Terms())
        other = references.document(options.against)
        before = None if other is None else RunRecords.of(other, find, registry, label=snapshot.label)
    page = write_pages(folder, records, comparison=comparison, before=before, films=_films(options.films))
    say(f"report: {page}")
    return 0


def _label(document: dict[str, object], reference: str) -> str:
    stored = document.get("stored")
    return str(stored.get("name") or reference) if isinstance(stored, dict) else reference


def _films(folder: str | None) -> list[Path]:
    if folder is None:
        return []
    if not Path(folder).is_dir():
        raise UsageError(f"--films is {folder!r}, expected the folder of videos that drive-robust replay wrote.")
    return sorted(Path(folder).glob("replay-*.mp4"))


def _finder(folder: Path) -> Callable[[str], EpisodeResult | None]:
    """Return what finds an episode in a store; one that is not there or not whole is None."""
    files = RecordFiles(folder)

    def find(key: str) -> EpisodeResult | None:
        try:
            data = files.read(key)
            return None if data is None else decode_record(data).result
        except (OSError, ValueError):
            return None

    return find
