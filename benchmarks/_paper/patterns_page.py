"""The seven patterns as markdown, each with its written explanation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from _paper.markdown import NONE, figure, options_of, seeds_of, table
from _paper.patterns import Pattern
from _paper.published import AGENTS
from _paper.results import Results
from pytest_drive_robust.errors import UsageError

__all__ = ["explanations", "patterns_text"]

_SIGNS = {"appears": "yes", "does not appear": "no", "cannot be told": "?", "not driven": "not driven"}


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
        f"{len(results.routes)} routes, {seeds_of(results)}; written by `python benchmarks/paper.py`.",
        "Every comparison is a difference over the same routes with its 95 % interval (jackknife over routes),",
        "positive where the pattern holds. It *appears* (yes) when the interval lies above 0, *does not appear* (no)",
        "when it lies at or below 0, and *cannot be told* (?) when it holds both. A pattern appears when all its",
        "comparisons do, and does not when one does not. Of comparisons without any difference one in forty appears",
        "by chance. The paper gives no intervals: its column is the difference of its figures.",
        "Comparisons that are the same in both readings of the failures, `paper` and `released`, stand once.",
        "",
        *options_of(results),
        *table(("#", "pattern", "reading", "verdict", *AGENTS), overview, text_columns=4 + len(AGENTS)),
    ]
    for number, patterns in numbered:
        first = patterns[0]
        lines += ["", f"## {number}. {first.statement}"]
        lines += [line for text in (first.how, explained.get(first.key)) if text for line in ("", text)]
        for name, found in _distinct(readings, patterns):
            lines += ["", *_pattern_lines(name, found)]
    return "\n".join(lines) + "\n"


def _distinct(readings: Sequence[str], patterns: Sequence[Pattern]) -> list[tuple[str, Pattern]]:
    """Return (reading, pattern) pairs, or one pair with `both` if the pattern is equal in all readings."""
    if all(found == patterns[0] for found in patterns):
        return [("both", patterns[0])]
    return [(f"`{reading}`", found) for reading, found in zip(readings, patterns, strict=True)]


def _sign(pattern: Pattern, agent: str) -> str:
    verdict = pattern.verdict_of(agent)
    return NONE if verdict is None else _SIGNS[verdict]


def _pattern_lines(name: str, pattern: Pattern) -> list[str]:
    counted = Counter(part.verdict for part in pattern.parts)
    shares = ", ".join(f"{verdict} {count}" for verdict, count in counted.items())
    of = "both readings" if name == "both" else f"the reading {name}"
    lines = [f"In {of}: **{pattern.verdict}** (of {len(pattern.parts)} comparisons: {shares}).", ""]
    digits = f"+.{pattern.digits}f"
    rows = [
        (
            part.what,
            figure(part.estimate, digits),
            # a zero keeps its sign, which shows on which side of 0 the interval ends
            NONE if part.estimate is None else f"{part.estimate.low:{digits}} to {part.estimate.high:{digits}}",
            figure(part.paper, digits),
            part.verdict,
        )
        for part in pattern.parts
    ]
    return lines + table((f"difference in {pattern.unit}", "here", pattern.interval, "paper", "verdict"), rows)


def explanations(path: Path, patterns: Sequence[Pattern]) -> dict[str, str]:
    """Return the explanations of patterns by key: the texts under `## KEY` in a file; empty without the file.

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
