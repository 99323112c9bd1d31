"""The table of the paper as markdown."""

from __future__ import annotations

import textwrap

from _paper.agreement import DRAWS, agreement
from _paper.differences import LEAST, differences, pages_on
from _paper.estimates import comfort, degradation, driving_score, efficiency, success_rate
from _paper.markdown import CELLS, NONE, ends, figure, options_of, seeds_of, shown, table
from _paper.published import AGENTS, AVERAGES, CLEAN, PUBLISHED, SETTINGS, SHORT, published_average
from _paper.readings import NO_LATENCY, READINGS, SAME, Drives, called_in
from _paper.results import DrivenAgent, Results
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator

__all__ = ["table_text"]


def table_text(results: Results) -> str:
    """Return the page with a summary, then every agent and row in both readings, ours beside the paper's."""
    same = ", ".join(SHORT[row] for row in SAME)
    lines = [
        "# The paper's table",
        "",
        f"{len(results.routes)} routes, {seeds_of(results)}, simulator {results.world['simulator']}; "
        "written by `python benchmarks/paper.py`.",
        "RD = 1 - DS / DS clean. Intervals are 95 %, over routes: Student's for DS, Wilson's for SR,",
        "Fieller's for RD (paired by route; the jackknife's where rows have different clean drives).",
        "Efficiency is the speed in percent of the traffic's, comfort the percentage of comfortable",
        "segments. The paper drove the original networks in CARLA on 220 routes, without intervals; ours",
        "are compact re-implementations in the embedded world: compare patterns, not levels.",
        *_each_route_once(results),
        *_stop(results),
        *_other_world(results),
        "",
        "Its failures have two readings, `paper` (its equations) and `released` (its code). These rows are",
        "the same in both, driven once and shown in both:",
        f"{same}.",
        f"Bursts and latency differ. In `released` latency is compared with *{_row_name(NO_LATENCY)}*, a clean",
        "drive with the same ticks of neutral commands at its start. Averages are the paper's: plain means",
        "of the rows without latency, of those of latency, and of all eleven.",
        "",
        *_missing(results),
        *options_of(results),
        "## Without failures",
        "",
        *_overview(results),
        "",
        "## Agreement with the paper",
        "",
        "Spearman's rank correlation of RD, agent by setting, with the paper's cells. Its interval is 1.96",
        f"standard errors, from {DRAWS} draws of the routes with replacement (on Fisher's scale). Chance in the",
        "cells pulls the correlation itself towards 0: the more so, the fewer the routes.",
        "",
        *_agreements(results),
        "",
        "One agent alone, what costs it more and what less, over its eleven rows and over the eight without",
        "latency; *off by* is the mean absolute difference of RD:",
        "",
        *_agreements_by_agent(results),
        "",
        *_differences(results),
        "## RD (the paper's)",
    ]
    for reading in READINGS:
        lines += ["", f"Reading `{reading}`:", "", *_glance(Drives(results, reading))]
    for agent, driven in results.agents.items():
        lines += ["", f"## {agent}", "", _made_of(driven)]
        for reading in READINGS:
            lines += ["", f"Reading `{reading}`:", "", *_agent_table(Drives(results, reading), agent)]
    return "\n".join(lines) + "\n"


def _other_world(results: Results) -> list[str]:
    """Return lines that name today's world if the episodes come from another world; comparisons within them hold."""
    today = f"{EmbeddedSimulator.name} {EmbeddedSimulator.version}"
    if results.world["simulator"] == today:
        return []
    return [f"Today's world is {today}: the commands beside this table do not give these figures to the digit."]


def _each_route_once(results: Results) -> list[str]:
    return ["A route counts once: its figures are the means over the seeds."] if len(results.seeds) > 1 else []


def _stop(results: Results) -> list[str]:
    agents: dict[float | None, list[str]] = {}
    for name, driven in results.agents.items():
        agents.setdefault(driven.stuck_stop_s, []).append(f"`{name}`")
    if list(agents) == [None]:
        return ["Every episode was driven to its end, as there."]
    said = [
        f"{stop_s:g} s" + (f" (of {', '.join(of)})" if len(agents) > 1 else "")
        for stop_s, of in agents.items()
        if stop_s is not None
    ]
    return textwrap.wrap(
        f"An episode ended when its car had stood still for {' or '.join(said)}, by `drive_stuck_stop`; there it goes "
        "on, and some cars get away after all.",
        96,
    )


def _missing(results: Results) -> list[str]:
    """Return lines with the missing drives by reading; no lines when nothing is missing."""
    lines = []
    for reading in READINGS:
        counts = {
            agent: sum(Drives(results, reading).scores(agent, row) is None for row in (CLEAN, *SETTINGS))
            for agent in AGENTS
        }
        lacking = [
            agent if agent not in results.agents else f"{agent} in {count} of {1 + len(SETTINGS)} rows"
            for agent, count in counts.items()
            if count
        ]
        if lacking:
            lines += [f"Not driven in the reading `{reading}`: {', '.join(lacking)}."]
    return [*lines, ""] if lines else []


def _made_of(driven: DrivenAgent) -> str:
    abreast = driven.versions.get("lockstep")
    how = f", {abreast} episodes in lockstep" if abreast else ""
    return f"`{driven.called}`: {driven.made_of['distribution']}, weights {driven.made_of['weights'] or 'none'}{how}."


def _overview(results: Results) -> list[str]:
    drives = Drives(results, READINGS[0])  # all readings share the clean drive
    rows = []
    for agent in AGENTS:
        paper = PUBLISHED[agent][CLEAN]
        rows.append(
            (
                agent,
                shown(driving_score(drives, agent, (CLEAN,)), ".1f"),
                shown(success_rate(drives, agent, (CLEAN,)), ".0f", 100.0),
                figure(efficiency(drives, agent, (CLEAN,)), ".0f"),
                figure(comfort(drives, agent, (CLEAN,)), ".0f"),
                f"{paper.ds:.1f}",
                f"{paper.sr_pct:.0f}",
                f"{paper.efficiency:.0f}",
                f"{paper.comfort:.0f}",
            )
        )
    header = ("agent, clean", "DS", "SR %", "Eff.", "Comf.", "paper: DS", "SR %", "Eff.", "Comf.")
    return table(header, rows)


def _agreements(results: Results) -> list[str]:
    rows = []
    for reading in READINGS:
        for name, settings in CELLS.items():
            found = agreement(Drives(results, reading), settings)
            between = NONE if found.correlation is None else ends(found.correlation, ".2f")
            rows.append(
                (
                    f"`{reading}`, {name}",
                    f"{found.driven} of {found.cells}",
                    figure(found.correlation, ".2f"),
                    between,
                    figure(found.difference, ".2f"),
                )
            )
    return table(("reading, cells", "driven", "rank correlation", "95 %", "mean abs. difference"), rows)


def _agreements_by_agent(results: Results) -> list[str]:
    rows = []
    for reading in READINGS:
        for agent in results.agents:
            found = [
                agreement(Drives(results, reading), settings, [agent])
                for settings in (SETTINGS, CELLS["without latency"])
            ]
            numbers = [
                (figure(one.correlation, ".2f"), NONE if one.correlation is None else ends(one.correlation, ".2f"))
                for one in found
            ]
            differences = [figure(one.difference, ".2f") for one in found]
            rows.append((f"`{reading}`", agent, *numbers[0], differences[0], *numbers[1], differences[1]))
    header = ("reading", "agent", "all", "95 %", "off by", "without latency", "95 %", "off by")
    return table(header, rows, text_columns=2)


def _differences(results: Results) -> list[str]:
    """Return lines with the cells that differ from the paper's in the reading `released`; none when none differs."""
    cells = differences(Drives(results, READINGS[-1]))
    if not cells:
        return []
    pages = [pages_on(cell.agent, cell.row) for cell in cells]
    rows = [
        (
            cell.agent,
            SHORT[cell.row],
            ", ".join(f"[{page}]" for page in tried) or NONE,
            figure(cell.here, ".2f"),
            figure(cell.paper, ".2f"),
        )
        for cell, tried in zip(cells, pages, strict=True)
    ]
    return [
        f"Cells of the reading `{READINGS[-1]}` that differ from the paper's by {LEAST} or more, and the pages that",
        "change one factor of the agent under this failure, at this severity or another. What was found is",
        "in [explanations.md](explanations.md).",
        "",
        *table(("agent", "setting", "tried in", "RD", "paper"), rows, text_columns=3),
        "",
        *(f"[{page}]: ../ablations/{page}.md" for page in sorted({page for tried in pages for page in tried})),
        "",
    ]


def _glance(drives: Drives) -> list[str]:
    """Return RD of every agent and row, then of the averages, in one small table."""
    groups = {**{setting: (setting,) for setting in SETTINGS}, **AVERAGES}
    rows = [
        (
            name,
            *(
                f"{figure(degradation(drives, agent, settings), '.2f')} "
                f"({figure(published_average(agent, settings).rd, '.2f')})"
                for agent in AGENTS
            ),
        )
        for name, settings in groups.items()
    ]
    return table(("setting", *AGENTS), rows)


def _agent_table(drives: Drives, agent: str) -> list[str]:
    warm = [] if called_in(drives.reading, NO_LATENCY) == CLEAN else [NO_LATENCY]
    plain = [CLEAN, *AVERAGES["avg. perturbed"], *warm, *AVERAGES["avg. latency"]]
    rows = [_agent_row(drives, agent, row, (row,)) for row in plain]
    rows += [_agent_row(drives, agent, name, settings) for name, settings in AVERAGES.items()]
    header = ("setting", "DS", "SR %", "RD", "95 %", "Eff.", "Comf.", "paper: DS", "SR %", "RD", "Eff.", "Comf.")
    return table(header, rows)


def _agent_row(drives: Drives, agent: str, name: str, rows: tuple[str, ...]) -> tuple[str, ...]:
    """Return one row of an agent's table; the paper drove no clean run with the warm-up."""
    is_clean = name in (CLEAN, NO_LATENCY)
    lost = None if is_clean else degradation(drives, agent, rows)
    paper = None if name == NO_LATENCY else published_average(agent, rows)
    return (
        _row_name(name),
        figure(driving_score(drives, agent, rows), ".1f"),
        figure(success_rate(drives, agent, rows), ".1f", 100.0),
        figure(lost, ".2f"),
        NONE if lost is None else ends(lost, ".2f"),
        figure(efficiency(drives, agent, rows), ".0f"),
        figure(comfort(drives, agent, rows), ".0f"),
        *(
            (NONE,) * 5
            if paper is None
            else (
                figure(paper.ds, ".1f"),
                figure(paper.sr_pct, ".1f"),
                NONE if is_clean else figure(paper.rd, ".2f"),
                figure(paper.efficiency, ".0f"),
                figure(paper.comfort, ".0f"),
            )
        ),
    )


def _row_name(row: str) -> str:
    return "clean, warmed up" if row == NO_LATENCY else SHORT.get(row, row)
