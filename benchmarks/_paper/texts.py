"""The table and the patterns as markdown."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from _paper.agreement import DRAWS, agreement
from _paper.estimates import IntervalEstimate, comfort, degradation, driving_score, efficiency, success_rate
from _paper.patterns import Pattern
from _paper.published import AGENTS, AVERAGES, CLEAN, PUBLISHED, SETTINGS, SHORT, published_average
from _paper.readings import NO_LATENCY, READINGS, SAME, Drives, called_in
from _paper.results import DrivenAgent, Results
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator

__all__ = ["explanations", "patterns_text", "table_text"]

_NONE = "-"
_LEFT = "---"
_RIGHT = "---:"
_PARTS = {"without latency": "avg. perturbed", "latency": "avg. latency"}
_SIGNS = {"appears": "yes", "does not appear": "no", "cannot be told": "?", "not driven": "not driven"}


def table_text(results: Results) -> str:
    """Write every agent and row in both readings, ours beside the paper's, under what they come to."""
    same = ", ".join(SHORT[row] for row in SAME)
    lines = [
        "# The paper's table",
        "",
        f"{len(results.routes)} routes, {_seeds(results)}, simulator {results.world['simulator']}; "
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
        *_options(results),
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
    """Say which world there is today, where the episodes are of another one. Comparisons within them stand."""
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
    """Return what was not driven, by reading; nothing when all was."""
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


def _options(results: Results) -> list[str]:
    called = [f"`{name}` is `{driven.called}`" for name, driven in results.agents.items() if driven.called != name]
    return [f"Agents with options: {', '.join(called)}.", ""] if called else []


def _made_of(driven: DrivenAgent) -> str:
    abreast = driven.versions.get("lockstep")
    how = f", {abreast} episodes in lockstep" if abreast else ""
    return f"`{driven.called}`: {driven.made_of['distribution']}, weights {driven.made_of['weights'] or 'none'}{how}."


def _overview(results: Results) -> list[str]:
    drives = Drives(results, READINGS[0])  # clean is the same drive in all
    rows = []
    for agent in AGENTS:
        paper = PUBLISHED[agent][CLEAN]
        rows.append(
            (
                agent,
                _shown(driving_score(drives, agent, (CLEAN,)), ".1f"),
                _shown(success_rate(drives, agent, (CLEAN,)), ".0f", 100.0),
                _number(efficiency(drives, agent, (CLEAN,)), ".0f"),
                _number(comfort(drives, agent, (CLEAN,)), ".0f"),
                f"{paper.ds:.1f}",
                f"{paper.sr_pct:.0f}",
                f"{paper.efficiency:.0f}",
                f"{paper.comfort:.0f}",
            )
        )
    header = ("agent, clean", "DS", "SR %", "Eff.", "Comf.", "paper: DS", "SR %", "Eff.", "Comf.")
    return _table(header, rows)


def _agreements(results: Results) -> list[str]:
    rows = []
    for reading in READINGS:
        for name, settings in (("all", SETTINGS), *((key, AVERAGES[average]) for key, average in _PARTS.items())):
            found = agreement(Drives(results, reading), settings)
            between = _NONE if found.correlation is None else _range(found.correlation, ".2f")
            rows.append(
                (
                    f"`{reading}`, {name}",
                    f"{found.driven} of {found.cells}",
                    _number(found.correlation, ".2f"),
                    between,
                    _number(found.difference, ".2f"),
                )
            )
    return _table(("reading, cells", "driven", "rank correlation", "95 %", "mean abs. difference"), rows)


def _agreements_by_agent(results: Results) -> list[str]:
    rows = []
    for reading in READINGS:
        for agent in results.agents:
            found = [
                agreement(Drives(results, reading), settings, [agent])
                for settings in (SETTINGS, AVERAGES[_PARTS["without latency"]])
            ]
            numbers = [
                (_number(one.correlation, ".2f"), _NONE if one.correlation is None else _range(one.correlation, ".2f"))
                for one in found
            ]
            differences = [_number(one.difference, ".2f") for one in found]
            rows.append((f"`{reading}`", agent, *numbers[0], differences[0], *numbers[1], differences[1]))
    header = ("reading", "agent", "all", "95 %", "off by", "without latency", "95 %", "off by")
    return _table(header, rows, text_columns=2)


def _glance(drives: Drives) -> list[str]:
    """Return RD of every agent and row, then of the averages, in one small table."""
    groups = {**{setting: (setting,) for setting in SETTINGS}, **AVERAGES}
    rows = [
        (
            name,
            *(
                f"{_number(degradation(drives, agent, settings), '.2f')} "
                f"({_number(published_average(agent, settings).rd, '.2f')})"
                for agent in AGENTS
            ),
        )
        for name, settings in groups.items()
    ]
    return _table(("setting", *AGENTS), rows)


def _agent_table(drives: Drives, agent: str) -> list[str]:
    warm = [] if called_in(drives.reading, NO_LATENCY) == CLEAN else [NO_LATENCY]
    plain = [CLEAN, *AVERAGES["avg. perturbed"], *warm, *AVERAGES["avg. latency"]]
    rows = [_agent_row(drives, agent, row, (row,)) for row in plain]
    rows += [_agent_row(drives, agent, name, settings) for name, settings in AVERAGES.items()]
    header = ("setting", "DS", "SR %", "RD", "95 %", "Eff.", "Comf.", "paper: DS", "SR %", "RD", "Eff.", "Comf.")
    return _table(header, rows)


def _agent_row(drives: Drives, agent: str, name: str, rows: tuple[str, ...]) -> tuple[str, ...]:
    """Return one row of an agent's table; the paper drove no clean run with the warm-up."""
    is_clean = name in (CLEAN, NO_LATENCY)
    lost = None if is_clean else degradation(drives, agent, rows)
    paper = None if name == NO_LATENCY else published_average(agent, rows)
    return (
        _row_name(name),
        _number(driving_score(drives, agent, rows), ".1f"),
        _number(success_rate(drives, agent, rows), ".1f", 100.0),
        _number(lost, ".2f"),
        _NONE if lost is None else _range(lost, ".2f"),
        _number(efficiency(drives, agent, rows), ".0f"),
        _number(comfort(drives, agent, rows), ".0f"),
        *(
            (_NONE,) * 5
            if paper is None
            else (
                _number(paper.ds, ".1f"),
                _number(paper.sr_pct, ".1f"),
                _NONE if is_clean else _number(paper.rd, ".2f"),
                _number(paper.efficiency, ".0f"),
                _number(paper.comfort, ".0f"),
            )
        ),
    )


def _row_name(row: str) -> str:
    return "clean, warmed up" if row == NO_LATENCY else SHORT.get(row, row)


def patterns_text(results: Results, by_reading: Mapping[str, Sequence[Pattern]], explained: Mapping[str, str]) -> str:
    """Write which of the patterns appear in which reading: an overview by agent, then every comparison."""
    numbered = list(enumerate(zip(*by_reading.values(), strict=True), start=1))
    readings = list(by_reading)
    overview = [
        (str(number), found.statement, name, f"**{found.verdict}**", *(_sign(found, agent) for agent in AGENTS))
        for number, patterns in numbered
        for name, found in _distinct(readings, patterns)
    ]
    lines = [
        "# Seven patterns of the paper's table",
        "",
        f"{len(results.routes)} routes, {_seeds(results)}; written by `python benchmarks/paper.py`.",
        "Every comparison is a difference over the same routes with its 95 % interval (jackknife over routes),",
        "positive where the pattern holds. It *appears* (yes) when the interval lies above 0, *does not appear* (no)",
        "when it lies at or below 0, and *cannot be told* (?) when it holds both. A pattern appears when all its",
        "comparisons do, and does not when one does not. Of comparisons without any difference one in forty appears",
        "by chance. The paper gives no intervals: its column is the difference of its figures.",
        "Comparisons that are the same in both readings of the failures, `paper` and `released`, stand once.",
        "",
        *_options(results),
        *_table(("#", "pattern", "reading", "verdict", *AGENTS), overview, text_columns=4 + len(AGENTS)),
    ]
    for number, patterns in numbered:
        first = patterns[0]
        lines += ["", f"## {number}. {first.statement}"]
        lines += [line for text in (first.how, explained.get(first.key)) if text for line in ("", text)]
        for name, found in _distinct(readings, patterns):
            lines += ["", *_pattern_lines(name, found)]
    return "\n".join(lines) + "\n"


def _seeds(results: Results) -> str:
    *first, last = map(str, results.seeds)
    return f"seeds {', '.join(first)} and {last}" if first else f"seed {last}"


def _distinct(readings: Sequence[str], patterns: Sequence[Pattern]) -> list[tuple[str, Pattern]]:
    """Return the pattern by reading, once as `both` where it is the same in all."""
    if all(found == patterns[0] for found in patterns):
        return [("both", patterns[0])]
    return [(f"`{reading}`", found) for reading, found in zip(readings, patterns, strict=True)]


def _sign(pattern: Pattern, agent: str) -> str:
    verdict = pattern.verdict_of(agent)
    return _NONE if verdict is None else _SIGNS[verdict]


def _pattern_lines(name: str, pattern: Pattern) -> list[str]:
    counted = Counter(part.verdict for part in pattern.parts)
    shares = ", ".join(f"{verdict} {count}" for verdict, count in counted.items())
    of = "both readings" if name == "both" else f"the reading {name}"
    lines = [f"In {of}: **{pattern.verdict}** (of {len(pattern.parts)} comparisons: {shares}).", ""]
    digits = f"+.{pattern.digits}f"
    rows = [
        (
            part.what,
            _number(part.estimate, digits),
            # a sign even before a zero: it tells on which side of 0 the interval ends
            _NONE if part.estimate is None else f"{part.estimate.low:{digits}} to {part.estimate.high:{digits}}",
            _number(part.paper, digits),
            part.verdict,
        )
        for part in pattern.parts
    ]
    return lines + _table((f"difference in {pattern.unit}", "here", pattern.interval, "paper", "verdict"), rows)


def explanations(path: Path, patterns: Sequence[Pattern]) -> dict[str, str]:
    """Read what somebody wrote about a pattern, by its key: the text under `## KEY` in a file, which may lack.

    Raises `UsageError` for a heading that is no key.
    """
    if not path.exists():
        return {}
    keys = [pattern.key for pattern in patterns]
    found = {}
    for section in f"\n{path.read_text(encoding='utf-8')}".split("\n## ")[1:]:
        key, _, text = section.partition("\n")
        if key.strip() not in keys:
            raise UsageError(f"{path} explains {key.strip()!r}. The patterns are {', '.join(keys)}.")
        found[key.strip()] = text.strip()
    return found


def _shown(estimate: IntervalEstimate | None, digits: str, factor: float = 1.0) -> str:
    """Return a value with its interval."""
    if estimate is None:
        return _NONE
    return f"{_number(estimate, digits, factor)} ({_range(estimate, digits, factor)})"


def _range(estimate: IntervalEstimate, digits: str, factor: float = 1.0) -> str:
    """Return the ends; one that is rounded to zero keeps its sign, which tells whether the interval holds 0."""
    return f"{factor * estimate.low:{digits}} to {factor * estimate.high:{digits}}"


def _number(value: IntervalEstimate | float | None, digits: str, factor: float = 1.0) -> str:
    """Return the value times `factor`, a zero without its sign; a dash where there is none."""
    if value is None:
        return _NONE
    text = format(factor * (value.value if isinstance(value, IntervalEstimate) else value), digits)
    return text if text.strip("+-0.") else text.lstrip("+-")


def _table(header: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> list[str]:
    rule = [_LEFT if place < text_columns else _RIGHT for place in range(len(header))]
    return [f"| {' | '.join(row)} |" for row in (header, rule, *rows)]
