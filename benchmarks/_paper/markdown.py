"""Common parts of all pages: markdown tables, numbers with intervals, seeds and options in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from _paper.estimates import IntervalEstimate
from _paper.published import AVERAGES, SETTINGS
from _paper.results import Results

__all__ = ["CELLS", "HALVES", "NONE", "ends", "figure", "options_of", "seeds_of", "shown", "table"]

NONE = "-"
_LEFT = "---"
_RIGHT = "---:"
HALVES = {"without latency": "avg. perturbed", "latency": "avg. latency"}
"""The two groups of rows on every page, and the paper's average of each group."""

CELLS = {"all": SETTINGS, **{name: AVERAGES[average] for name, average in HALVES.items()}}
"""The rows of each rank correlation, by name."""


def seeds_of(results: Results) -> str:
    """Return the seeds in words."""
    *first, last = map(str, results.seeds)
    return f"seeds {', '.join(first)} and {last}" if first else f"seed {last}"


def options_of(results: Results) -> list[str]:
    """Return lines with the agents that were driven with options; no lines without such agents."""
    called = [f"`{name}` is `{driven.called}`" for name, driven in results.agents.items() if driven.called != name]
    return [f"Agents with options: {', '.join(called)}.", ""] if called else []


def shown(estimate: IntervalEstimate | None, digits: str, factor: float = 1.0) -> str:
    """Return a value with its interval."""
    if estimate is None:
        return NONE
    return f"{figure(estimate, digits, factor)} ({ends(estimate, digits, factor)})"


def ends(estimate: IntervalEstimate, digits: str, factor: float = 1.0) -> str:
    """Return the ends of an interval; a zero keeps its sign, which tells whether the interval holds 0."""
    return f"{factor * estimate.low:{digits}} to {factor * estimate.high:{digits}}"


def figure(value: IntervalEstimate | float | None, digits: str, factor: float = 1.0) -> str:
    """Return the value times `factor`, a zero without its sign; a dash without a value."""
    if value is None:
        return NONE
    text = format(factor * (value.value if isinstance(value, IntervalEstimate) else value), digits)
    return text if text.strip("+-0.") else text.lstrip("+-")


def table(header: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> list[str]:
    """Return the lines of a table; columns after the first `text_columns` hold figures, which stand right."""
    rule = [_LEFT if place < text_columns else _RIGHT for place in range(len(header))]
    return [f"| {' | '.join(row)} |" for row in (header, rule, *rows)]
