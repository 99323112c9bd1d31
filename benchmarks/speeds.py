"""How fast agents drive here and in CARLA: length through time of each route that was driven to its end, clean.

Efficiency compares an agent with its traffic, and that differs between worlds; metres per second do not. Files are
reports of `--drive-json`, and results of the official evaluator (a file or a folder), as the authors of TCP, UniAD and
VAD published them beside their code. Reports of the same agent are one row, and of an episode that is in several of
them the last one counts:

    python benchmarks/speeds.py tcp.json vad.json TCP-only-traj.json UniAD-Base.json VAD.json

    median    of the completed routes, m/s, with the quartiles
    mean s    what a completed route takes in the world's time
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import DriveRobustError, UsageError

CLEAN = "clean"
FEWEST = 2
"""Least number of completed routes, because quartiles need two."""


@dataclass(frozen=True, slots=True)
class Driven:
    """One driven route: its length in m, its time in s, and whether the agent completed the route."""

    length_m: float
    game_s: float
    completed: bool


Place = tuple[str | Path, int]
"""The key of a drive of an agent: route and seed of a report, or official file and place in the file."""


def drives_of(path: Path) -> Iterator[tuple[str, Mapping[Place, Driven]]]:
    """Yield each agent of a file with its clean drives; official results have no agent's name and get the file's name.

    Raises `UsageError` for a file of neither kind.
    """
    report = _report(path)
    if report is None:
        records = read_results(path).records
        whole = [
            Driven(record.length_m * record.route_pct / 100.0, record.game_s, record.status in ("Completed", "Perfect"))
            for record in records
            if not record.is_harness_error and record.game_s > 0.0
        ]
        yield path.stem, {(path, place): drive for place, drive in enumerate(whole)}
        return
    clean = [
        episode
        for episode in report["episodes"]
        if episode["setting"] == CLEAN and episode["outcome"] != Outcome.INFRA_ERROR.value and episode["ticks"]
    ]
    for agent in dict.fromkeys(episode["agent"] for episode in clean):
        yield (
            agent,
            {
                (one["route_id"], one["seed"]): Driven(
                    one["route_length_m"], one["game_s"], one["outcome"] == Outcome.COMPLETED.value
                )
                for one in clean
                if one["agent"] == agent
            },
        )


def _report(path: Path) -> dict[str, Any] | None:
    if path.is_dir():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} cannot be read as JSON: {error}.") from error
    return document if isinstance(document, dict) and "episodes" in document else None


def _require_same_agent(agent: str, known: Mapping[Place, Driven], more: Mapping[Place, Driven], path: Path) -> None:
    """Raise `UsageError` for drives that may belong to another agent, as official results have only a file name."""
    official = any(isinstance(source, Path) for source, _ in (*known, *more))
    if known and official and known.keys().isdisjoint(more):
        raise UsageError(
            f"{path} holds {agent!r}, as a file before it does, and official results do not say whether that is the "
            "same agent. Give each file of them a name of its own."
        )


def row_of(agent: str, drives: Sequence[Driven]) -> tuple[str, ...]:
    """Return the cells of one agent. Raises `UsageError` where fewer than two routes were completed."""
    speeds = [drive.length_m / drive.game_s for drive in drives if drive.completed]
    if len(speeds) < FEWEST:
        raise UsageError(f"{agent} completed {len(speeds)} of {len(drives)} routes. Expected at least {FEWEST}.")
    low, median, high = statistics.quantiles(speeds, n=4, method="inclusive")
    return (
        agent,
        str(len(drives)),
        str(len(speeds)),
        f"{median:.2f} ({low:.2f} to {high:.2f})",
        f"{statistics.mean(drive.game_s for drive in drives if drive.completed):.1f}",
    )


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a report, or official results")
    table = Table(title="m/s of completed routes, without failures")
    for name in ("agent", "drives", "completed", "median m/s (quartiles)", "mean s"):
        table.add_column(name, justify="left" if name == "agent" else "right", no_wrap=True)
    found: dict[str, dict[Place, Driven]] = {}
    try:
        for path in parser.parse_args(argv).files:
            for agent, drives in drives_of(path):
                known = found.setdefault(agent, {})
                _require_same_agent(agent, known, drives, path)
                known.update(drives)
        for agent, drives in found.items():
            table.add_row(*row_of(agent, list(drives.values())))
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
