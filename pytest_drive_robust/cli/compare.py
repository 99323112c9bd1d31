"""`drive-robust compare`: is run B worse than run A?"""

from __future__ import annotations

import argparse
import sys

from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.cli.references import references_of
from pytest_drive_robust.domain.verdict_rule import VERDICT_KINDS
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import one_of, writable_file
from pytest_drive_robust.regression.allowance import parse_allowances
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.document import json_text
from pytest_drive_robust.regression.fingerprint import parse_policy
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.report.json_file import comparison_as_json
from pytest_drive_robust.report.page import columns_of_screen
from pytest_drive_robust.store.whole_file import write_whole

_known_rule = one_of(VERDICT_KINDS, "verdict rule")
_known_mode = one_of(("warn", "fail"), "way to treat inconclusive verdicts")
_DESCRIPTION = """Judges whether run B is worse than run A. Runs of different machines and versions compare exactly in
the embedded world, for agents that promise the same bits everywhere (blind, classical, constant, expert, random,
reactive). What other agents compute depends on the processor and on versions: their records tell both, and the
comparison says where they differ."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `compare`."""
    parser.description = _DESCRIPTION
    reference = "a stored run, latest, a JSON file of a run, baseline, or baseline:AGENT"
    parser.add_argument("before", metavar="A", help=reference)
    parser.add_argument("after", metavar="B", help="as A")
    parser.add_argument(
        "--fail-on",
        action="append",
        default=[],
        metavar="LIMIT",
        help="fail what gets worse by more than this, as in ds:-3%%, sr:-0.05, rd:+0.05; repeatable; default: ds:-5%%",
    )
    add_pytest_option(
        parser,
        "--verdict",
        help="judge by this rule: evidence, list, point; auto: evidence, or list with fewer than 20 routes of the "
        "same seeds",
    )
    add_pytest_option(parser, "--on-mismatch")
    add_pytest_option(parser, "--inconclusive", help="treat inconclusive verdicts on changed scores so: warn or fail")
    add_pytest_option(parser, "--json", help="write what was found to FILE")
    add_pytest_option(parser, "--baselines")
    parser.set_defaults(command=_compare)


def _compare(options: argparse.Namespace) -> int:
    terms = Terms(
        allowances=parse_allowances(options.fail_on, source="--fail-on"),
        rule=_known_rule(GivenText("--verdict", options.verdict)),
        policy=parse_policy(GivenText("--on-mismatch", options.on_mismatch)),
        open_fails=_known_mode(GivenText("--inconclusive", options.inconclusive)) == "fail",
    )
    path = writable_file(GivenText("--json", options.json))
    references = references_of(options)
    after = references.load(options.after)
    before = references.load(options.before, simulator=after.simulator)
    if before.label == after.label or references.is_same_file(options.before, options.after):
        raise UsageError(
            f"A and B are both {after.label!r}, and no run is worse than itself. `drive-robust runs list` shows all."
        )
    comparison = compare(before, after, terms)
    is_terminal = sys.stdout.isatty()
    print(comparison_text(comparison, colour=is_terminal, width=columns_of_screen(is_terminal=is_terminal)))
    if path is not None:
        write_whole(path, json_text(comparison_as_json(comparison)))
    if comparison.refusals:
        return 4
    return 1 if comparison.regressed else 0
