"""The comparison of two seeds as markdown."""

from __future__ import annotations

from _paper.agreement import agreement
from _paper.estimates import degradation, driving_score
from _paper.markdown import CELLS, HALVES, figure, seeds_of, shown, table
from _paper.published import AVERAGES, CLEAN, SHORT
from _paper.readings import READINGS, SAME, Drives, cells_of
from _paper.results import Results
from _paper.seeds import Apart, OnRoutes, apart_of, difference, on_routes_of

__all__ = ["seeds_text"]


def seeds_text(seeds: tuple[Results, Results]) -> str:
    """Return the page that compares two seeds."""
    first, second = (seeds_of(results) for results in seeds)
    agents = list(seeds[0].agents)
    cells, apart = cells_of(seeds[0]), apart_of(seeds)
    lines = [
        "# Two seeds, one against the other",
        "",
        f"{len(seeds[0].routes)} routes, {first} and {second}; written by `python benchmarks/seeds.py`.",
        "Is a figure of one seed to be trusted? The same agents on the same routes under the same settings; a",
        "difference is of the second seed less the first, with its interval over the routes:",
        "",
        *table(("agent", "figure", first, second, "difference"), _figures(seeds), text_columns=2),
        "",
        "Rank correlation with the paper's cells:",
        "",
        *table(("reading, cells", first, second), _agreements(seeds)),
        "",
        "## What the seed changes on one route",
        "",
        "Episodes that end with another DS or another success with the second seed, and the share of the variance",
        "within a cell that is the routes', not the seed's (intraclass correlation). The higher it is, the less a",
        "second seed says: with a share s it narrows an interval as (1 - s) / (1 + s) more routes do, and",
        "costs as much time as all of them again.",
        "",
        *table(
            (
                "agent",
                "episodes",
                "other DS",
                "other success",
                "routes' share of DS",
                "of RD",
                "a second seed is worth, for RD",
            ),
            [_changed_row(agent, on_routes_of(seeds, agent)) for agent in agents],
        ),
        "",
        "## Cells in which the seeds differ",
        "",
        "RD of one agent under one setting, with two seeds further apart than 1.96 standard errors of the difference",
        f"(the jackknife's over the routes). Of {len(cells)} cells, those that are the same in both readings once,",
        f"chance alone makes {len(cells) / 20:.1f} on average, often several: an agent has one clean drive.",
        f"Found: {len(apart)}.",
        "",
        *(
            table(("agent", "setting", "reading", first, second), map(_apart_row, apart), text_columns=3)
            if apart
            else ()
        ),
    ]
    return "\n".join(lines).rstrip("\n") + "\n"


def _figures(seeds: tuple[Results, Results]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for agent in seeds[0].agents:
        scores = [driving_score(Drives(results, READINGS[0]), agent, (CLEAN,)) for results in seeds]
        change = difference(seeds, READINGS[0], agent, (CLEAN,))
        rows.append((agent, "clean DS", *(figure(score, ".1f") for score in scores), shown(change, ".1f")))
        for reading in READINGS:
            for name, average in HALVES.items():
                lost = [degradation(Drives(results, reading), agent, AVERAGES[average]) for results in seeds]
                change = difference(seeds, reading, agent, AVERAGES[average])
                rows.append(
                    (agent, f"`{reading}`, {name}", *(figure(one, ".2f") for one in lost), shown(change, ".2f"))
                )
    return rows


def _agreements(seeds: tuple[Results, Results]) -> list[tuple[str, ...]]:
    return [
        (
            f"`{reading}`, {name}",
            *(figure(agreement(Drives(one, reading), rows).correlation, ".2f") for one in seeds),
        )
        for reading in READINGS
        for name, rows in CELLS.items()
    ]


def _changed_row(agent: str, found: OnRoutes) -> tuple[str, ...]:
    return (
        agent,
        str(found.episodes),
        f"{100 * found.other_score / found.episodes:.0f} %",
        f"{100 * found.other_success / found.episodes:.0f} %",
        figure(found.score, ".2f"),
        figure(found.degradation, ".2f"),
        f"{100 * (1 - found.degradation) / (1 + found.degradation):.0f} % more routes",
    )


def _apart_row(apart: Apart) -> tuple[str, ...]:
    reading = "both" if apart.row in SAME else f"`{apart.reading}`"
    return apart.agent, SHORT[apart.row], reading, *(shown(lost, ".2f") for lost in apart.lost)
