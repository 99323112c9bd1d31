"""`drive-robust report`: a stored run as a folder of pages."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.cli.references import add_run, references_of
from pytest_drive_robust.cli.store import existing_store
from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.regression.fingerprint import parse_policy
from pytest_drive_robust.regression.references import project_store
from pytest_drive_robust.report.pages.folder import check_folder, write_pages
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.store.lookup import stored_episodes
from pytest_drive_robust.store.whole_file import refusing_unwritable

_DESCRIPTION = """Writes a run as a folder of pages: verdicts, evidence, what went wrong, replays, what changed against
another run. Open its index.html; it needs no network and no server. The episodes come from the store; those that are
not there are listed, but cannot be replayed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `report`."""
    parser.description = _DESCRIPTION
    add_run(parser)
    parser.add_argument(
        "--against", metavar="BASE", help="also show what changed against this run, baseline or baseline:AGENT"
    )
    add_pytest_option(parser, "--on-mismatch")
    parser.add_argument(
        "--out", metavar="DIR", default="drive-report", help="write the pages here; default: drive-report"
    )
    parser.add_argument("--store", metavar="FOLDER", help="read the episodes from this store; default: .drive-robust")
    parser.add_argument("--films", metavar="FOLDER", help="show the videos that drive-robust replay wrote to FOLDER")
    add_pytest_option(parser, "--baselines")
    parser.set_defaults(command=_report)


def _report(options: argparse.Namespace) -> int:
    folder = Path(options.out)
    check_folder(folder, source="--out")
    registry, store = default_registry(), existing_store(options) if options.store else None
    records = RunRecords.stored(options.run, registry, store=store)
    comparison = before = None
    if options.against is not None:
        after = snapshot_of(records.document, label=records.label)
        references = references_of(options)
        snapshot = references.load(options.against, simulator=after.simulator)
        policy = parse_policy(GivenText("--on-mismatch", options.on_mismatch))
        comparison = compare(snapshot, after, Terms(policy=policy))
        other = references.document(options.against)
        if other is not None:
            find = stored_episodes(store or project_store())
            before = RunRecords.of(other, find, registry, label=snapshot.label)
    films = _films(options.films)
    with refusing_unwritable(folder):
        page = write_pages(folder, records, comparison=comparison, before=before, films=films)
    say(f"report: {page}")
    return 0


def _films(folder: str | None) -> list[Path]:
    if folder is None:
        return []
    if not Path(folder).is_dir():
        raise UsageError(f"--films is {folder!r}, expected the folder of videos that drive-robust replay wrote.")
    return sorted(Path(folder).glob("replay-*.mp4"))
