"""`drive-robust bless`: accept a run as the baseline that later runs are compared with."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.cli.references import add_run, references_of
from pytest_drive_robust.regression import clock, git
from pytest_drive_robust.regression.baselines import Blessing
from pytest_drive_robust.regression.bless import bless

_DESCRIPTION = """Accepts a run as the baseline that later runs are compared with. In the embedded world it holds to
the bit on any machine, with any version of Python and of libraries that we allow, for agents that promise it
(blind, classical, constant, expert, random, reactive). What other agents compute depends on the processor and on those
versions: bless them on the kind of machine on which they are compared."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `bless`."""
    parser.description = _DESCRIPTION
    add_run(parser)
    parser.add_argument(
        "--reason", required=True, metavar="TEXT", help="say why; stored in the baseline, for reviewers"
    )
    parser.add_argument(
        "--replace-routes",
        action="store_true",
        help="also replace scores of routes that changed under the same id",
    )
    parser.add_argument(
        "--only", action="store_true", help="drop scores of routes that RUN did not drive under its settings"
    )
    add_pytest_option(parser, "--baselines")
    parser.set_defaults(command=_bless)


def _bless(options: argparse.Namespace) -> int:
    references = references_of(options)
    run = references.load_run(options.run)
    today, author = clock.today().isoformat(), git.author(Path.cwd())
    signature = Blessing(today, options.reason.strip(), author, run=run.label, commit=run.commit)
    accepted = bless(
        run,
        references.baselines,
        signature,
        environ=os.environ,
        replace_routes=options.replace_routes,
        only=options.only,
    )
    for blessed in accepted:
        dropped = f", {blessed.dropped} dropped" if options.only else ""
        print(
            f"{blessed.path}: {blessed.agent}, {blessed.added} scores added, {blessed.replaced} replaced, "
            f"{blessed.kept} others kept{dropped}"
        )
        if blessed.beside:
            print(
                f"{blessed.beside} of the kept scores are of other routes under the same settings: a run that does not "
                "drive these routes, too, is refused. --only drops these scores."
            )
    print("Review the change and commit it.")
    return 0
