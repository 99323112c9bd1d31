"""Compare two seeds on equal agents, routes and settings.

Differences on a route come from the seed alone, and show the value of a second seed compared with more routes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from _paper.estimates import IntervalEstimate, Means, degradation, ds_means, gap, rd_means, standard_error
from _paper.parts import on_routes
from _paper.published import CLEAN
from _paper.readings import Drives, cells_of
from _paper.results import DrivenAgent, Results, Scores
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.quantiles import normal_quantile

__all__ = ["Apart", "OnRoutes", "apart_of", "difference", "on_routes_of", "two_seeds"]

_SEEDS = 2


@dataclass(frozen=True, slots=True)
class OnRoutes:
    """The effect of the seed on single routes, of one agent.

    `episodes` were driven with each seed; `other_score` and `other_success` of these ended differently with the second
    seed. `score` and `degradation` are the routes' share, at most 1, of the variance of DS and of RD within a cell; the
    rest is the seed's. A share below 0 is chance.
    """

    episodes: int
    other_score: int
    other_success: int
    score: float
    degradation: float


@dataclass(frozen=True, slots=True)
class Apart:
    """One cell (RD of an agent in a row) that differs significantly between the seeds."""

    reading: str
    agent: str
    row: str
    lost: tuple[IntervalEstimate, IntervalEstimate]


def two_seeds(files: Sequence[Results]) -> tuple[Results, Results]:
    """Return the results with the lower seed and with the higher seed, on the agents and routes with both.

    Raises `ComparisonError` unless the files hold exactly two seeds, for a seed that is in two files, for seeds that
    share no agent or fewer than two routes, for a route with two definitions, and for an agent with different settings,
    options, weights or stop of standing cars.
    """
    found = sorted((part for results in files for part in _by_seed(results)), key=lambda part: part.seeds)
    seeds = [part.seeds[0] for part in found]
    if len(seeds) != _SEEDS or len(set(seeds)) != _SEEDS:
        raise ComparisonError(
            f"the files hold the seeds {', '.join(map(str, seeds))}. Expected two, each in one file: `paper.py` puts "
            "files of one seed together."
        )
    first, second = found
    if first.world != second.world:
        raise ComparisonError(f"one seed was driven in {dict(first.world)}, the other in {dict(second.world)}.")
    routes = [route for route in first.routes if route in second.routes]
    agents = [name for name in first.agents if name in second.agents]
    if len(routes) < _SEEDS or not agents:
        raise ComparisonError("the seeds share fewer than two routes, or no agent.")
    other = [route for route in routes if first.routes[route] != second.routes[route]]
    if other:
        raise ComparisonError(
            f"the routes {', '.join(other[:5])} have these ids with both seeds, but other definitions."
        )
    for name in agents:
        lacking = [
            *(setting for setting in first.agents[name].settings if setting not in second.agents[name].settings),
            *(setting for setting in second.agents[name].settings if setting not in first.agents[name].settings),
        ]
        if lacking:
            raise ComparisonError(
                f"{name} under {', '.join(lacking[:3])} was driven with one of the seeds only. Drive it with the "
                "other, too, or leave the agent out of one file (`paper.py --only`)."
            )
        one, other = (part.agents[name].driven_as for part in found)
        if one != other:
            raise ComparisonError(f"{name} was driven as {one} and as {other}. Expected the same with both seeds.")
    kept = [on_routes(replace(part, agents={name: part.agents[name] for name in agents}), routes) for part in found]
    return kept[0], kept[1]


def _by_seed(results: Results) -> list[Results]:
    def of(driven: DrivenAgent, place: int) -> DrivenAgent:
        settings = {name: Scores((scores.of_seeds[place],)) for name, scores in driven.settings.items()}
        return replace(driven, settings=settings)

    return [
        replace(results, seeds=(seed,), agents={name: of(driven, place) for name, driven in results.agents.items()})
        for place, seed in enumerate(results.seeds)
    ]


def difference(
    seeds: tuple[Results, Results], reading: str, agent: str, rows: Sequence[str]
) -> IntervalEstimate | None:
    """Return the RD with the second seed minus the RD with the first; for the row `clean`, the difference of DS."""
    first, second = (Drives(results, reading) for results in seeds)
    if tuple(rows) == (CLEAN,):
        return gap(ds_means(second, agent, CLEAN), ds_means(first, agent, CLEAN))
    return gap(rd_means(second, agent, rows), rd_means(first, agent, rows))


def on_routes_of(seeds: tuple[Results, Results], agent: str) -> OnRoutes:
    """Compare the episodes of one agent."""
    first, second = (results.agents[agent].settings for results in seeds)
    scores = [(first[name].driving_score, second[name].driving_score) for name in first]
    successes = [(first[name].success, second[name].success) for name in first]
    means = [
        [rd_means(Drives(results, reading), agent, (row,)) for results in seeds]
        for reading, driven, row in cells_of(seeds[0])
        if driven == agent
    ]
    return OnRoutes(
        sum(len(one) for one, _ in scores),
        sum(one != other for pair in scores for one, other in zip(*pair, strict=True)),
        sum(one != other for pair in successes for one, other in zip(*pair, strict=True)),
        _share_of_routes(scores),
        _share_of_routes([[_of_each_route(one) for one in of_cell if one is not None] for of_cell in means]),
    )


def _of_each_route(means: Means) -> NDArray[np.float64]:
    """Return the jackknife's pseudo-value of each route: its contribution to RD times the number of routes."""
    routes = len(means) - 1
    return routes * means[0] - (routes - 1) * means[1:]


def _share_of_routes(cells: Sequence[Sequence[Sequence[float] | NDArray[np.float64]]]) -> float:
    """Return the intraclass correlation of pairs of values, one pair per route; variances are means over the cells.

    Source: Shrout and Fleiss 1979, ICC(1, 1). NaN when no values differ.
    """
    values = np.array(cells, dtype=np.float64)  # cells, seeds, routes
    of_routes = values.mean(axis=1)
    between = _SEEDS * of_routes.var(axis=1, ddof=1).mean()
    within = ((values - of_routes[:, None]) ** 2).sum(axis=1).mean()
    return float((between - within) / (between + within)) if between + within > 0.0 else float("nan")


def apart_of(seeds: tuple[Results, Results]) -> list[Apart]:
    """Return the cells whose RD differs by more than 1.96 standard errors (the jackknife's over the routes)."""
    return [
        Apart(reading, agent, row, (lost[0], lost[1]))
        for reading, agent, row in cells_of(seeds[0])
        for means in [[rd_means(Drives(results, reading), agent, (row,)) for results in seeds]]
        if _differ(means[0], means[1])
        for lost in [[degradation(Drives(results, reading), agent, (row,)) for results in seeds]]
    ]


def _differ(first: Means, second: Means) -> bool:
    change = second - first
    return bool(abs(change[0]) > normal_quantile(0.975) * standard_error(change))
