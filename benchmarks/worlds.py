"""What another world changed, episode by episode: the same agents, weights, settings, routes and seeds in both.

Each file is what `paper.py` takes, a report of `--drive-json` or its `results.json`. What only one of them holds is
left out. The first one is of the older world:

    python benchmarks/worlds.py benchmarks/paper/results.json newer/results.json

    other DS       episodes with another driving score; then its mean over all of them, in both
    other success  episodes that succeeded in one of them only
    RD             of a row, over the routes and seeds that both files hold
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from _paper.joining import read
from _paper.readings import clean_of
from _paper.results import Results
from rich.console import Console
from rich.table import Table

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.errors import ComparisonError, DriveRobustError


class Drives(NamedTuple):
    """One row in one world: driving scores 0..100 and successes, in the same order in both worlds."""

    scores: tuple[float, ...]
    successes: tuple[bool, ...]


Rows = Mapping[str, tuple[Drives, Drives]]
"""The drives of one agent under each setting, in the older and in the newer world."""


def rows_of(older: Results, newer: Results) -> dict[str, Rows]:
    """Return by agent the rows in both results.

    Raises `ComparisonError` when the results share no route, seed or row, and for an agent with different options,
    weights or stop of standing cars, because then not only the world differs.
    """
    routes = [route for route, facts in older.routes.items() if newer.routes.get(route) == facts]
    seeds = [seed for seed in older.seeds if seed in newer.seeds]
    agents = [
        name
        for name in older.agents
        if name in newer.agents and older.agents[name].settings.keys() & newer.agents[name].settings
    ]
    if not (routes and seeds and agents):
        raise ComparisonError(
            "the files share no route of the same definition, no seed or no agent under the same setting. Give others."
        )
    for name in agents:
        first, second = (world.agents[name].driven_as for world in (older, newer))
        if first != second:
            raise ComparisonError(f"{name} was driven as {first} and as {second}. Expected the same in both worlds.")
    return {
        name: {
            setting: (_drives(older, name, setting, routes, seeds), _drives(newer, name, setting, routes, seeds))
            for setting in older.agents[name].settings
            if setting in newer.agents[name].settings
        }
        for name in agents
    }


def _drives(world: Results, agent: str, setting: str, routes: Sequence[str], seeds: Sequence[int]) -> Drives:
    order = list(world.routes)
    places = [order.index(route) for route in routes]
    of_seeds = [world.agents[agent].settings[setting].of_seeds[world.seeds.index(seed)] for seed in seeds]
    return Drives(
        tuple(one.driving_score[place] for one in of_seeds for place in places),
        tuple(one.success[place] for one in of_seeds for place in places),
    )


def largest_change(rows: Rows) -> str:
    """Return the largest difference of RD and its setting; "-" when no row has an RD.

    A row has no RD without its clean drives, or when the clean driving score is 0.
    """
    changes = [
        (abs(_rd(rows, setting, 1) - _rd(rows, setting, 0)), setting)
        for setting in rows
        if (clean := clean_of(setting)) != setting and clean in rows and all(any(one.scores) for one in rows[clean])
    ]
    return "{:.3f}, {}".format(*max(changes)) if changes else "-"


def _rd(rows: Rows, setting: str, world: int) -> float:
    return 1.0 - mean(rows[setting][world].scores) / mean(rows[clean_of(setting)][world].scores)


def counts(rows: Sequence[tuple[Drives, Drives]]) -> tuple[str, ...]:
    """Return the counted cells: episodes, episodes with another score, mean scores, episodes with another success."""
    scores = [pair for older, newer in rows for pair in zip(older.scores, newer.scores, strict=True)]
    successes = [pair for older, newer in rows for pair in zip(older.successes, newer.successes, strict=True)]
    before, after = (mean(values) for values in zip(*scores, strict=True))
    return (
        str(len(scores)),
        str(sum(one != other for one, other in scores)),
        f"{before:.2f} -> {after:.2f}",
        str(sum(one != other for one, other in successes)),
    )


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("older", type=Path, help="driven in the older world")
    parser.add_argument("newer", type=Path, help="driven in the newer world")
    arguments = parser.parse_args(argv)
    try:
        older, newer = read([arguments.older]), read([arguments.newer])
        found = rows_of(older, newer)
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
    table = Table(title=f"{older.world['simulator']} -> {newer.world['simulator']}")
    for column in ("agent", "episodes", "other DS", "mean DS", "other success", "largest change of RD"):
        table.add_column(column, justify="left" if column == "agent" else "right")
    for name, rows in found.items():
        table.add_row(name, *counts(tuple(rows.values())), largest_change(rows))
    table.add_section()
    table.add_row("all", *counts([pair for rows in found.values() for pair in rows.values()]), "")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
