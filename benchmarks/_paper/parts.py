"""Compare parts of the routes: the first route of each scenario type, the second route, and so on.

Parts share no route, and each part has every type once, so their differences show how far one part can be trusted.
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
"""Least number of routes of a part; with fewer routes the intervals of a cell are wider than any RD."""


@dataclass(frozen=True, slots=True)
class Apart:
    """One cell (RD of an agent in a row) whose values in two parts (counted from 1) differ significantly."""

    reading: str
    agent: str
    row: str
    parts: tuple[int, int]
    lost: tuple[IntervalEstimate, IntervalEstimate]


@dataclass(frozen=True, slots=True)
class Compared:
    """The comparison of every two parts in each of `cells`; of `pairs` without difference 1 in 20 is `apart`."""

    cells: int
    pairs: int
    apart: tuple[Apart, ...]


def on_routes(results: Results, kept: Collection[str]) -> Results:
    """Return the results on some of the routes; comfort, which exists only over all routes, stays unchanged."""
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
    """Return the parts, as many as each type has routes; empty if each type has one route.

    Empty also when a part has fewer than `FEWEST_ROUTES` routes, or when an agent's clean driving score is above 0 on
    fewer than two routes of a part: the jackknife leaves out one route, and there is no RD without a clean score.
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
    """Compare every two parts in each driven cell; a cell that both readings share counts once."""
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
