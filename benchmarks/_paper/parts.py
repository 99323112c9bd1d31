"""Parts of the routes: the first of each scenario type, the second and so on.

No two share a route and each has every type once, so what differs between them tells how far one is to be trusted.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from _paper.estimates import IntervalEstimate, degradation, rd_means, standard_error
from _paper.readings import Drives, cells_of, clean_of
from _paper.results import Results, Scores, SeedScores
from pytest_drive_robust.stats.quantiles import normal_quantile

__all__ = ["FEWEST_ROUTES", "Apart", "Compared", "compared", "on_routes", "parts_of"]

FEWEST_ROUTES = 20
"""Parts of fewer are not compared: the intervals of a cell are then wider than any RD."""


@dataclass(frozen=True, slots=True)
class Apart:
    """One cell, RD of an agent in a row, in two parts (counted from 1) that differ by more than chance makes."""

    reading: str
    agent: str
    row: str
    parts: tuple[int, int]
    lost: tuple[IntervalEstimate, IntervalEstimate]


@dataclass(frozen=True, slots=True)
class Compared:
    """Every two parts in each of `cells`; of `pairs` without any difference one in twenty is `apart`."""

    cells: int
    pairs: int
    apart: tuple[Apart, ...]


def on_routes(results: Results, kept: Collection[str]) -> Results:
    """Return what was driven on some of the routes; comfort, which is of no single route, stays that of all."""
    places = [place for place, route in enumerate(results.routes) if route in kept]

    def of(one: SeedScores) -> SeedScores:
        columns = (one.driving_score, one.success, one.efficiency)
        return SeedScores(*(tuple(column[place] for place in places) for column in columns), one.comfort)

    agents = {
        name: replace(
            driven,
            settings={setting: Scores(tuple(map(of, scores.of_seeds))) for setting, scores in driven.settings.items()},
        )
        for name, driven in results.agents.items()
    }
    routes = {route: facts for route, facts in results.routes.items() if route in kept}
    return replace(results, routes=routes, agents=agents)


def parts_of(results: Results) -> tuple[Results, ...]:
    """Return the parts: as many as each type has routes, none where that is one.

    None also where a part has fewer than `FEWEST_ROUTES`, or an agent without a score on all of it but one route:
    without it there is no RD.
    """
    by_type = defaultdict(list)
    for route, (scenario, _) in results.routes.items():
        by_type[scenario].append(route)
    parts = tuple(on_routes(results, routes) for routes in zip(*by_type.values(), strict=False))
    comparable = len(parts) > 1 and len(by_type) >= FEWEST_ROUTES and all(map(_has_rd, parts))
    return parts if comparable else ()


def _has_rd(part: Results) -> bool:
    return all(
        sum(score > 0.0 for score in driven.settings[clean_of(setting)].driving_score) > 1
        for driven in part.agents.values()
        for setting in driven.settings
    )


def compared(parts: Sequence[Results]) -> Compared:
    """Compare every two parts in each cell that was driven; a cell that is the same in both readings counts once."""
    cells = cells_of(parts[0])
    apart = [one for cell in cells for one in _apart(parts, *cell)]
    return Compared(len(cells), len(cells) * len(list(combinations(parts, 2))), tuple(apart))


def _apart(parts: Sequence[Results], reading: str, agent: str, row: str) -> list[Apart]:
    drives = [Drives(part, reading) for part in parts]
    means = [found for one in drives if (found := rd_means(one, agent, (row,))) is not None]
    lost = [found for one in drives if (found := degradation(one, agent, (row,))) is not None]
    return [
        Apart(reading, agent, row, (first + 1, second + 1), (lost[first], lost[second]))
        for first, second in combinations(range(len(parts)), 2)
        if abs(means[first][0] - means[second][0])
        > normal_quantile(0.975) * np.hypot(standard_error(means[first]), standard_error(means[second]))
    ]
