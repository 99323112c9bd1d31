"""`drive-robust runs`, `compare` and `bless`: stored runs, their comparison, and the accepted baseline."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.regression.references import References

__all__ = ["add_commands"]

_WIDTH = 100
_REFERENCES = "a stored run, latest, a JSON file of a run, baseline, or baseline:AGENT"


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `runs list`, `compare` and `bless` to the commands of a parser."""
    runs = commands.add_parser("runs", help="the runs that --drive-save stored")
    what = runs.add_subparsers(required=True, metavar="WHAT")
    listing = what.add_parser("list", help="name, date, commit, agents and size of each, the oldest first")
    listing.set_defaults(command=_list)

    compare = commands.add_parser("compare", help="is run B worse than run A? Exit code 1 when it is")
    compare.add_argument("before", metavar="A", help=_REFERENCES)
    compare.add_argument("after", metavar="B", help="as A")
    compare.add_argument(
        "--fail-on",
        action="append",
        default=[],
        metavar="LIMIT",
        help="what may get worse, and by how much, as in ds:-3%%, sr:-0.05, rd:+0.05; repeatable; default: ds:-5%%",
    )
    compare.add_argument(
        "--verdict",
        default="auto",
        metavar="RULE",
        help="evidence, list, point or auto (default: evidence, but the list below 20 routes of the same seeds)",
    )
    compare.add_argument(
        "--on-mismatch",
        default="default",
        metavar="POLICY",
        help="warn or refuse when the two were not driven with the same; default: refuse other routes and simulators, "
        "warn of other versions",
    )
    compare.set_defaults(command=_compare)

    bless = commands.add_parser("bless", help="accept a run as the baseline that later runs are compared with")
    bless.add_argument("run", metavar="RUN", help="a stored run, latest, or the JSON file of a run")
    bless.add_argument("--reason", required=True, metavar="TEXT", help="why; it is stored and reviewed")
    bless.add_argument("--replace-routes", action="store_true", help="also where routes of the same id have changed")
    bless.set_defaults(command=_bless)

    for command in (compare, bless):
        command.add_argument("--baselines", metavar="FOLDER", help="default: suites/baselines")


def _list(options: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.table import Table

    from pytest_drive_robust.regression.runs import RunFolder, home_of

    folder = RunFolder(home_of(Path.cwd()))
    runs = folder.runs()
    if not runs:
        print("no stored run. Store one with pytest --drive-robust --drive-save")
        return 0
    table = Table(box=None, pad_edge=False, padding=(0, 1), header_style="bold")
    for column in ("name", "date", "commit", "agents", "settings", "episodes"):
        right = column in ("settings", "episodes")
        table.add_column(column, justify="right" if right else "left", overflow="fold")
    for run in runs:
        if run.problem:
            table.add_row(run.name, "not a run")
        else:
            counts = str(run.settings), str(run.episodes)
            table.add_row(run.name, run.date.partition("+")[0], run.commit, ", ".join(run.agents), *counts)
    Console(width=None if sys.stdout.isatty() else _WIDTH, markup=False, highlight=False).print(table)
    for run in runs:
        if run.problem:
            print(run.problem)
    return 0


def _compare(options: argparse.Namespace) -> int:
    from pytest_drive_robust.regression.allowance import parse_allowances
    from pytest_drive_robust.regression.comparison import compare
    from pytest_drive_robust.regression.fingerprint import parse_policy
    from pytest_drive_robust.regression.outcome import Terms
    from pytest_drive_robust.regression.verdicts import parse_kind
    from pytest_drive_robust.report.comparison import comparison_text

    terms = Terms(
        allowances=parse_allowances(options.fail_on, source="--fail-on"),
        kind=parse_kind(options.verdict, source="--verdict"),
        policy=parse_policy(options.on_mismatch),
    )
    references = _references(options)
    after = references.load(options.after)
    before = references.load(options.before, simulator=after.simulator)
    comparison = compare(before, after, terms)
    print(comparison_text(comparison, colour=sys.stdout.isatty()))
    if comparison.refusals:
        return 4
    return 1 if comparison.regressions else 0


def _bless(options: argparse.Namespace) -> int:
    import os

    from pytest_drive_robust.regression import clock, git
    from pytest_drive_robust.regression.blessing import Signature, bless

    references = _references(options)
    run = references.load_run(options.run)
    signature = Signature(
        reason=options.reason,
        date=clock.today().isoformat(),
        by=git.author(Path.cwd()),
        run=run.label,
        commit=run.commit,
    )
    replace_routes = options.replace_routes
    for blessed in bless(run, references.baselines, signature, environ=os.environ, replace_routes=replace_routes):
        print(
            f"{blessed.path}: {blessed.agent}, {blessed.added} scores added, {blessed.replaced} replaced, "
            f"{blessed.kept} others kept"
        )
    print("Review the change and commit it.")
    return 0


def _references(options: argparse.Namespace) -> References:
    from pytest_drive_robust.regression.references import References
    from pytest_drive_robust.regression.runs import home_of

    return References(home_of(Path.cwd()), Path(options.baselines) if options.baselines else None)
