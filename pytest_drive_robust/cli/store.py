"""`drive-robust store`: count, verify and remove the finished episodes in the store."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.cli.tables import LEFT, RIGHT, print_table
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import time_limit_s
from pytest_drive_robust.regression.references import project_store
from pytest_drive_robust.report.numbers import counted, duration_text
from pytest_drive_robust.store.maintenance import Statistics, set_aside, statistics, sweep, verify
from pytest_drive_robust.store.record_files import is_store

_MEGA = 1e6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `store stats`, `store verify` and `store gc`."""
    what = parser.add_subparsers(required=True, metavar="WHAT")
    stats = what.add_parser("stats", help="count episodes by agent and outcome, their megabytes and their driving time")
    stats.set_defaults(command=_stats)
    verify = what.add_parser(
        "verify", help="read every record to its last byte. Exit code 1 when one is damaged or cannot be read"
    )
    verify.add_argument("--fix", action="store_true", help="move damaged records to aside/, to drive them again")
    verify.set_defaults(command=_verify)
    gc = what.add_parser(
        "gc",
        help="remove damaged records, leftover files of processes that died, and the episodes that the options name. "
        "Exit code 1 when one could not be removed",
    )
    gc.add_argument("--older-than", metavar="TIME", help="also remove records older than this, as in 30d or 12h")
    gc.add_argument(
        "--agent",
        action="append",
        default=[],
        metavar="NAME",
        help="also remove records of this agent, with --older-than only its old ones; repeatable",
    )
    gc.add_argument("--dry-run", action="store_true", help="remove nothing, only tell what would be removed")
    gc.set_defaults(command=_gc)
    for command in (stats, verify, gc):
        command.add_argument(
            "--store", metavar="FOLDER", help="the store; default: .drive-robust, here or in a folder above"
        )


def _stats(options: argparse.Namespace) -> int:
    found = statistics(existing_store(options))
    print(
        f"{found.folder}: {counted(found.records, 'episode')}, {found.size_bytes / _MEGA:.1f} MB, "
        f"{duration_text(found.wall_s)} of driving, {counted(found.runs, 'run')}"
    )
    if found.by_agent:
        _print_agents(found)
    again = found.records - found.unreadable - found.reusable
    if again:
        print(f"{again} ended in timeouts, crashes or errors of the simulator: other runs drive them again")
    if found.unreadable:
        print(f"{found.unreadable} cannot be read: see drive-robust store verify")
    if found.set_aside:
        print(f"damaged records in {found.folder / 'aside'}: {found.set_aside}")
    return 0


def _print_agents(found: Statistics) -> None:
    outcomes = sorted({outcome for _, outcome in found.by_agent})
    agents = sorted({agent for agent, _ in found.by_agent})
    rows = [(agent, *(str(found.by_agent.get((agent, outcome), 0)) for outcome in outcomes)) for agent in agents]
    print_table({"agent": LEFT, **dict.fromkeys(outcomes, RIGHT)}, rows)


def _verify(options: argparse.Namespace) -> int:
    folder = existing_store(options)
    count, damages = verify(folder)
    for damage in damages:
        print(f"{damage.path}: {damage.problem}")
    damaged = [damage for damage in damages if damage.is_certain]
    unread = sum(damage.unread for damage in damages)
    more = f", {unread} that could not be read" if unread else ""
    print(f"{folder}: {counted(count, 'episode')}, {len(damaged)} damaged{more}")
    if not damaged:
        return 1 if unread else 0
    if not options.fix:
        print("A run that needs a damaged record moves it to aside/ and drives the episode again. --fix moves all now.")
        return 1
    moved = set_aside(folder, damaged)
    print(f"{moved} moved to {folder / 'aside'}")
    return 0 if moved == len(damaged) and not unread else 1


def _gc(options: argparse.Namespace) -> int:
    folder = existing_store(options)
    older_than_s = None if options.older_than is None else _age_s(options.older_than)
    if options.agent:
        known = {agent for agent, _ in statistics(folder).by_agent}
        for agent in options.agent:
            if agent not in known:
                raise UnknownNameError.of("agent", agent, known, hint=f"The store is {str(folder)!r}.")
    swept = sweep(folder, older_than_s=older_than_s, agents=options.agent, dry=options.dry_run)
    removed = f"{counted(swept.records, 'episode')}, {counted(swept.damaged, 'damaged record')}"
    leftovers = f"{counted(swept.leftovers, 'leftover')} of processes that died"
    did = "would remove" if options.dry_run else "removed"
    print(f"{folder}: {did} {removed} and {leftovers}, {swept.size_bytes / _MEGA:.1f} MB")
    if not swept.problems:
        return 0
    print(f"{counted(len(swept.problems), 'file')} could not be removed, first {swept.problems[0]}")
    return 1


def _age_s(text: str) -> float:
    """Return an age in seconds. Raises `UsageError` for no age, which would remove new records with the old ones."""
    age_s = time_limit_s(GivenText("--older-than", text))
    if age_s is None:
        raise UsageError(f"--older-than is {text!r}, expected a time such as 30d or 12h.")
    return age_s


def existing_store(options: argparse.Namespace) -> Path:
    """Return the store that `--store` names, else that of the project. Raises `UsageError` where there is none."""
    folder = Path(options.store) if options.store else project_store()
    if not folder.is_dir():
        advice = "" if options.store else " Give --store the folder that --drive-store named in the run."
        raise UsageError(f"there is no store {str(folder)!r}.{advice}")
    if not is_store(folder):
        raise UsageError(
            f"{str(folder)!r} is not a store: it has no folder 'episodes'. The default store is .drive-robust."
        )
    return folder
