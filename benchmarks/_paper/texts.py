"""The table and the patterns as markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from _paper.estimates import IntervalEstimate, degradation, driving_score, efficiency, mean_degradation, success_rate
from _paper.patterns import Pattern
from _paper.published import AGENTS, CLEAN, PUBLISHED, SETTINGS, published_mean_rd
from _paper.results import DrivenAgent, Results
from pytest_drive_robust.errors import UsageError

__all__ = ["explanations", "patterns_text", "table_text"]

_NONE = "-"
_LEFT = "---"
_RIGHT = "---:"
_SIGNS = {"appears": "yes", "does not appear": "no", "cannot be told": "?", "not driven": "not driven"}


def table_text(results: Results) -> str:
    """Write every agent and setting, ours beside the paper's, under an overview of the agents."""
    missing = [_missing(agent, results.agents.get(agent)) for agent in AGENTS]
    lines = [
        "# The paper's table",
        "",
        f"{len(results.routes)} routes, seed {results.world['seed']}, simulator {results.world['simulator']}; "
        "written by `python benchmarks/paper.py`.",
        "RD = 1 - DS / DS clean. Intervals are 95 %, over routes: Student's for DS, Wilson's for SR,",
        "Fieller's for RD (paired by route). Efficiency is the speed in percent of the traffic's. The paper",
        "drove the original networks in CARLA on 220 routes, without intervals; ours are compact",
        "re-implementations in the embedded world: compare patterns, not levels.",
        "",
    ]
    if any(missing):
        lines += [f"Not driven: {', '.join(filter(None, missing))}.", ""]
    lines += [*_overview(results), "", "## RD (the paper's)", "", *_glance(results)]
    for agent in results.agents:
        made_of, abreast = results.agents[agent].made_of, results.agents[agent].versions.get("lockstep")
        lines += ["", f"## {agent}", "", *_agent_table(results, agent), ""]
        how = f", {abreast} episodes in lockstep" if abreast else ""
        lines += [f"{made_of['distribution']}, weights {made_of['weights']}{how}."]
    return "\n".join(lines) + "\n"


def _missing(agent: str, driven: DrivenAgent | None) -> str:
    """Return what of an agent was not driven, empty when all was."""
    if driven is None:
        return agent
    lacking = sum(setting not in driven.settings for setting in SETTINGS)
    return f"{agent} under {lacking} of {len(SETTINGS)} settings" if lacking else ""


def _overview(results: Results) -> list[str]:
    rows = []
    for agent in AGENTS:
        clean = PUBLISHED[agent][CLEAN]
        rows.append(
            (
                agent,
                _shown(driving_score(results, agent, CLEAN), ".1f"),
                _shown(success_rate(results, agent, CLEAN), ".0f", 100.0),
                _shown(mean_degradation(results, agent), ".2f"),
                f"{clean.ds:.1f}",
                f"{clean.sr_pct:.0f}",
                f"{published_mean_rd(agent):.2f}",
            )
        )
    header = ("agent, clean", "DS", "SR %", "mean RD of 11 settings", "paper: DS", "SR %", "mean RD")
    return _table(header, rows)


def _glance(results: Results) -> list[str]:
    """Return RD of every agent and setting in one small table."""
    rows = [
        (setting, *(_beside(degradation(results, agent, setting), PUBLISHED[agent][setting].rd) for agent in AGENTS))
        for setting in SETTINGS
    ]
    means = [_beside(mean_degradation(results, agent), published_mean_rd(agent)) for agent in AGENTS]
    return _table(("setting", *AGENTS), [*rows, ("mean of the eleven", *means)])


def _beside(ours: IntervalEstimate | None, paper: float) -> str:
    return f"{_number(ours, '.2f')} ({_number(paper, '.2f')})"


def _agent_table(results: Results, agent: str) -> list[str]:
    rows = []
    for setting in (CLEAN, *SETTINGS):
        score, success = driving_score(results, agent, setting), success_rate(results, agent, setting)
        lost = None if setting == CLEAN else degradation(results, agent, setting)
        paper = PUBLISHED[agent][setting]
        rows.append(
            (
                setting,
                _number(score, ".1f"),
                _number(success, ".1f", 100.0),
                _number(lost, ".2f"),
                _NONE if lost is None else _range(lost, ".2f"),
                _number(efficiency(results, agent, setting), ".0f"),
                _number(paper.ds, ".1f"),
                _number(paper.sr_pct, ".1f"),
                _NONE if setting == CLEAN else _number(paper.rd, ".2f"),
                _number(paper.efficiency, ".0f"),
            )
        )
    header = ("setting", "DS", "SR %", "RD", "95 %", "Eff.", "paper: DS", "SR %", "RD", "Eff.")
    return _table(header, rows)


def patterns_text(results: Results, patterns: Sequence[Pattern], explained: Mapping[str, str]) -> str:
    """Write which of the patterns appear: an overview by agent, then every comparison with its interval."""
    rows = [
        (str(number), pattern.statement, f"**{pattern.verdict}**", *(_sign(pattern, agent) for agent in AGENTS))
        for number, pattern in enumerate(patterns, start=1)
    ]
    lines = [
        "# Seven patterns of the paper's table",
        "",
        f"{len(results.routes)} routes, seed {results.world['seed']}; written by `python benchmarks/paper.py`.",
        "Every comparison is a difference over the same routes with its 95 % interval (jackknife over routes),",
        "positive where the pattern holds. It *appears* (yes) when the interval lies above 0, *does not appear* (no)",
        "when it lies at or below 0, and *cannot be told* (?) when it holds both. A pattern appears when all its",
        "comparisons do, and does not when one does not. Of comparisons without any difference one in forty appears",
        "by chance. The paper gives no intervals: its column is the difference of its figures.",
        "",
        *_table(("#", "pattern", "verdict", *AGENTS), rows, text_columns=3 + len(AGENTS)),
    ]
    for number, pattern in enumerate(patterns, start=1):
        lines += ["", f"## {number}. {pattern.statement}", "", *_pattern_lines(pattern, explained)]
    return "\n".join(lines) + "\n"


def _sign(pattern: Pattern, agent: str) -> str:
    verdict = pattern.verdict_of(agent)
    return _NONE if verdict is None else _SIGNS[verdict]


def _pattern_lines(pattern: Pattern, explained: Mapping[str, str]) -> list[str]:
    counted = Counter(part.verdict for part in pattern.parts)
    shares = ", ".join(f"{verdict} {count}" for verdict, count in counted.items())
    lines = [f"**{pattern.verdict}** (of {len(pattern.parts)} comparisons: {shares}). {pattern.how}".rstrip(), ""]
    if pattern.key in explained:
        lines += [explained[pattern.key], ""]
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
    return f"{_number(estimate.low, digits, factor)} to {_number(estimate.high, digits, factor)}"


def _number(value: IntervalEstimate | float | None, digits: str, factor: float = 1.0) -> str:
    """Return the value times `factor`, a zero without its sign; a dash where there is none."""
    if value is None:
        return _NONE
    text = format(factor * (value.value if isinstance(value, IntervalEstimate) else value), digits)
    return text if text.strip("+-0.") else text.lstrip("+-")


def _table(header: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> list[str]:
    rule = [_LEFT if place < text_columns else _RIGHT for place in range(len(header))]
    return [f"| {' | '.join(row)} |" for row in (header, rule, *rows)]
