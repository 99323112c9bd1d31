"""The comparison of parts of the routes as markdown."""

from __future__ import annotations

from collections.abc import Sequence

from _paper.agreement import agreement
from _paper.estimates import degradation, driving_score
from _paper.markdown import CELLS, HALVES, figure, seeds_of, shown, table
from _paper.parts import FEWEST_ROUTES, Apart, compared, parts_of
from _paper.published import AVERAGES, CLEAN, SHORT
from _paper.readings import READINGS, SAME, Drives
from _paper.results import Results

__all__ = ["parts_text"]


def parts_text(results: Results) -> str:
    """Return the page that compares the parts of the routes, or says why there are no parts to compare."""
    parts = parts_of(results)
    none = f"No parts to compare: they need {FEWEST_ROUTES} routes each, and a score of every agent that drives clean."
    lines = [
        "# Parts of the routes, one against another",
        "",
        f"{len(results.routes)} routes, {seeds_of(results)}; written by `python benchmarks/paper.py`.",
        *(_parts_lines(results, parts) if parts else [none]),
    ]
    return "\n".join(lines) + "\n"


def _parts_lines(results: Results, parts: Sequence[Results]) -> list[str]:
    found = compared(parts)
    numbers = [str(number) for number in range(1, len(parts) + 1)]
    return [
        "Part 1 has the first route of each scenario type, part 2 the second and so on, "
        f"{len(parts[0].routes)} each: how far may a table of so few",
        "routes be trusted? Mean RD over the rows without latency and over those of latency, and clean DS:",
        "",
        *table(("agent", "figure", *numbers, "all"), _figures_of_parts((*parts, results)), text_columns=2),
        "",
        "Rank correlation with the paper's cells:",
        "",
        *table(("reading, cells", *numbers, "all"), _agreements_of_parts((*parts, results))),
        "",
        "## Cells in which two parts differ",
        "",
        "RD of one agent under one setting, in two parts that are further apart than 1.96 standard errors (the",
        f"jackknife's). Every two parts were compared in {found.cells} cells, those that are the same in both readings",
        f"once: {found.pairs} pairs, of which chance alone makes {found.pairs / 20:.0f}. Found: {len(found.apart)}.",
        "",
        *table(
            ("agent", "setting", "reading", "part", "RD", "part", "RD"), map(_apart_row, found.apart), text_columns=3
        ),
    ]


def _figures_of_parts(parts: Sequence[Results]) -> list[tuple[str, ...]]:
    rows = []
    for agent in parts[0].agents:
        scores = [driving_score(Drives(part, READINGS[0]), agent, (CLEAN,)) for part in parts]
        rows.append((agent, "clean DS", *(figure(score, ".1f") for score in scores)))
        rows += [
            (agent, f"`{reading}`, {name}", *(figure(lost, ".2f") for lost in found))
            for reading in READINGS
            for name, average in HALVES.items()
            for found in [[degradation(Drives(part, reading), agent, AVERAGES[average]) for part in parts]]
        ]
    return rows


def _agreements_of_parts(parts: Sequence[Results]) -> list[tuple[str, ...]]:
    return [
        (
            f"`{reading}`, {name}",
            *(figure(agreement(Drives(part, reading), rows).correlation, ".2f") for part in parts),
        )
        for reading in READINGS
        for name, rows in CELLS.items()
    ]


def _apart_row(apart: Apart) -> tuple[str, ...]:
    return (
        apart.agent,
        SHORT[apart.row],
        "both" if apart.row in SAME else f"`{apart.reading}`",
        *(
            cell
            for number, lost in zip(apart.parts, apart.lost, strict=True)
            for cell in (str(number), shown(lost, ".2f"))
        ),
    )
