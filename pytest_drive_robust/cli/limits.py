"""`drive-robust limits`: propose limits for an agent out of a run that drove it."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.cli.references import A_RUN
from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.regression.proposed_limits import ProposedLimit, kept_requirements, propose_limits
from pytest_drive_robust.regression.references import read_run_document
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.store.whole_file import refusing_unwritable, write_whole

_DESCRIPTION = """Proposes a limit for each setting that an agent was driven under: the value that the agent showed,
plus the distance that a verdict from evidence needs on as many routes. Requirements without a proposal, such as those
on metrics of your own, are kept as they are. A limit states what you need, not what the agent does: review the file,
tighten what matters, commit it."""

_FEW_ROUTES = 12
"""With fewer routes an agent's values are mostly chance; verdicts from evidence seldom read fewer routes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `limits`."""
    parser.description = _DESCRIPTION
    parser.add_argument("--agent", required=True, metavar="NAME", help="propose limits for this agent of the run")
    parser.add_argument(
        "--run",
        default="latest",
        metavar="RUN",
        help=f"{A_RUN}; default: latest",
    )
    parser.add_argument("--out", metavar="FILE", help="write the limits to this new file; default: limits-AGENT.txt")
    parser.set_defaults(command=_limits)


def _limits(options: argparse.Namespace) -> int:
    path = Path(options.out or f"limits-{options.agent.replace(':', '-').replace('/', '-')}.txt")
    if path.exists():
        raise UsageError(
            f"{str(path)!r} exists and is not written over, because limits are reviewed. Give another name with --out."
        )
    document = read_run_document(options.run)
    rule = VerdictRule()
    found = propose_limits(
        snapshot_of(document, label=options.run),
        options.agent,
        perturbations=default_registry().perturbations(),
        rule=rule,
    )
    kept = kept_requirements(document.get("requirements", ()), options.agent, found)
    head = (
        f"# proposed by drive-robust limits: what {options.agent} showed, and the distance that evidence needs with a "
        f"margin of {rule.margin:.2f}\n# review: a limit states what you need, not what the agent does\n"
    )
    with refusing_unwritable(path):
        write_whole(path, head + "".join([*map(_line, found), *map(_kept_line, kept)]))
    also = f" and {len(kept)} more of the run's requirements, as they were" if kept else ""
    say(f"{path}: {counted(len(found), 'limit')}{also}. Review them, then commit the file.")
    fewest = min(item.routes for item in found)
    if fewest < _FEW_ROUTES:
        say(
            f"warning: {counted(fewest, 'route')} show little of an agent: other routes would give other limits. Drive "
            "the routes that the gate will drive, as with --drive-routes one-per-scenario (44), and propose again."
        )
    return 0


def _line(item: ProposedLimit) -> str:
    metric = item.requirement.metric
    value = metric.format(round(item.value, 6) + 0.0)  # no minus zero
    return f"{item.requirement!s:50}  # showed {value} on {item.routes} routes, {metric.format(item.spare)} to spare\n"


def _kept_line(sentence: str) -> str:
    return f"{sentence:50}  # kept as it was: no limit is proposed for it\n"
