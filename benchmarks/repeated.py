"""Compare episodes that were driven again with those of the paper's table: score, success and efficiency of each.

Drive any agents, routes and settings of the table, with one of its seeds. This command drives the third route of each
type in the four settings whose scores depend most on the machine:

    pytest --drive-robust suites/paper -k "test_paper_reading and (clean or gps or 0.8)" --drive-agent uniad \\
        --drive-verdict point --drive-routes $(seq -s, 103 100 4403) --drive-json again.json

`simlingo` also needs the table's `--drive-stuck-stop 45`. Then compare one such report, or several:

    python benchmarks/repeated.py again.json

The exit code is 1 if an episode differs. Other versions of libraries, or another kind of machine, are named: they may
be the reason. Other weights, options, routes or stops of standing cars are an error, because they make other episodes.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from _paper.reports import read_file
from _paper.results import OUR_CODE, DrivenAgent, Results

from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.errors import ComparisonError, DriveRobustError

TABLE = Path(__file__).parent / "paper" / "results.json"
SHOWN = 10
"""Most episodes that are named, of each report."""


class Episode(NamedTuple):
    """What the table holds of an episode: driving score 0..100, success, efficiency in percent of the traffic's."""

    driving_score: float
    success: bool
    efficiency: float | None

    def __str__(self) -> str:
        efficiency = "no efficiency" if self.efficiency is None else f"efficiency {self.efficiency:.2f}"
        return f"DS {self.driving_score:.2f}, {'success' if self.success else 'no success'}, {efficiency}"


class Pair(NamedTuple):
    """An episode of the table, and the same one driven again."""

    agent: str
    setting: str
    route: str
    seed: int
    table: Episode
    again: Episode


def pairs_of(table: Results, again: Results) -> Iterator[Pair]:
    """Yield each episode of `again` with that of `table`.

    Raises `ComparisonError` for another world, and for agents, settings, routes and seeds that the table lacks or that
    are others by their weights, options, definition or stop of standing cars.
    """
    if table.world != again.world:
        raise ComparisonError(f"driven in {dict(again.world)}, the table in {dict(table.world)}.")
    lacking = [route for route in again.routes if route not in table.routes]
    other = [route for route in again.routes if route not in lacking and again.routes[route] != table.routes[route]]
    seeds = [seed for seed in again.seeds if seed not in table.seeds]
    if lacking or seeds:
        raise ComparisonError(
            f"{_listed('routes', lacking)}{' and ' if lacking and seeds else ''}{_listed('seeds', seeds)} not in the "
            f"table, which has {len(table.routes)} routes and the seeds {', '.join(map(str, table.seeds))}."
        )
    if other:
        raise ComparisonError(f"routes {', '.join(other[:5])} have another definition than those of the table.")
    places = {route: place for place, route in enumerate(table.routes)}
    for name, driven in again.agents.items():
        _check_agent(table.agents.get(name), driven, name)
        for setting, scores in driven.settings.items():
            if setting not in table.agents[name].settings:
                raise ComparisonError(f"{name} under {setting} is not in the table.")
            for seed, of_seed in zip(again.seeds, scores.of_seeds, strict=True):
                before = table.agents[name].settings[setting].of_seeds[table.seeds.index(seed)]
                for number, route in enumerate(again.routes):
                    place = places[route]
                    then = Episode(before.driving_score[place], before.success[place], before.efficiency[place])
                    now = Episode(of_seed.driving_score[number], of_seed.success[number], of_seed.efficiency[number])
                    yield Pair(name, setting, route, seed, then, now)


def _listed(what: str, lacking: Sequence[object]) -> str:
    return f"{what} {', '.join(map(str, lacking[:5]))}" if lacking else ""


def _check_agent(table: DrivenAgent | None, again: DrivenAgent, name: str) -> None:
    if table is None:
        raise ComparisonError(f"{name} is not in the table.")
    if table.driven_as != again.driven_as:
        raise ComparisonError(f"{again.driven_as} drove again, in the table {table.driven_as}. Drive as in the table.")


def other_facts(table: DrivenAgent, again: DrivenAgent) -> Iterator[str]:
    """Yield what may change a score, of libraries and machine, where it differs from the table's."""
    for package, version in again.versions.items():
        before = table.versions.get(package)
        if package not in OUR_CODE and before != version:
            yield f"{package} {version}, in the table {before or 'not noted'}"
    for fact in sorted(again.machine.keys() & table.machine.keys()):
        if again.machine[fact] != table.machine[fact]:
            yield f"{MACHINE_FACTS[fact]} computes otherwise than on the table's machine"
    if not table.machine:
        yield "the table does not name the machine of all its drives"


def compare(table: Results, path: Path) -> int:
    """Print how many episodes of the report `path` differ from the table's, and return their number."""
    again = read_file(path)
    try:
        pairs = list(pairs_of(table, again))
    except ComparisonError as error:
        raise ComparisonError(f"{path}: {error}") from error
    differ = [pair for pair in pairs if pair.table != pair.again]
    driven_in = Counter((pair.agent, pair.setting) for pair in pairs)
    differ_in = Counter((pair.agent, pair.setting) for pair in differ)
    for name, driven in again.agents.items():
        for setting in driven.settings:
            key = name, setting
            print(f"  {driven.called:<10} {setting:<42} {driven_in[key]:6} {differ_in[key]:6}")
        for fact in other_facts(table.agents[name], driven):
            print(f"  {driven.called}: {fact}")
    for pair in differ[:SHOWN]:
        print(f"  {pair.agent}, {pair.setting}, {pair.route}, seed {pair.seed}:")
        print(f"    table  {pair.table}\n    again  {pair.again}")
    if len(differ) > SHOWN:
        print(f"  and {len(differ) - SHOWN} more")
    print(f"{path}: {len(differ)} of {len(pairs)} episodes differ")
    return len(differ)


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", nargs="+", type=Path, metavar="REPORT", help="a report of --drive-json")
    parser.add_argument("--table", type=Path, default=TABLE, metavar="FILE", help="instead of paper/results.json")
    given = parser.parse_args(argv)
    try:
        table = read_file(given.table)
        print(f"  {'agent':<10} {'setting':<42} {'driven':>6} {'differ':>6}")
        differ = [compare(table, path) for path in given.reports]
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
    sys.exit(1 if any(differ) else 0)


if __name__ == "__main__":
    main()
