"""The run as Markdown, for the step summary and the comment of a pull request."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from pytest_drive_robust.perturbations.readings import READINGS
from pytest_drive_robust.regression.comparison_result import CellComparison, Comparison
from pytest_drive_robust.report.comparison import conclusion
from pytest_drive_robust.report.numbers import counted, ends_text, in_percent, legible, shown, shown_beside
from pytest_drive_robust.report.promise import confidence
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.report.terminal import columns_of, footnotes, rows_of
from pytest_drive_robust.store.events import Judged

VARIABLE = "GITHUB_STEP_SUMMARY"
"""The environment variable in which GitHub Actions names the file to append to."""

_LOUD = ("fail", "error")
_MOST_FLIPS = 10
_METRICS = ("DS", "SR", "RD")
_VERDICT_HEADS = ("requirement", "agent", "value", "interval", "routes", "verdict")


def append_step_summary(run: RunResult, environ: Mapping[str, str], comparison: Comparison | None = None) -> None:
    """Append the summary to the file that `environ` names; without such a file do nothing. Raises `OSError`."""
    path = environ.get(VARIABLE, "")
    if not path:
        return
    text = step_summary(run, comparison)
    if text:
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(legible(text))


def step_summary(run: RunResult, comparison: Comparison | None = None) -> str:
    """Return verdicts, changes, the table of settings and footnotes as Markdown; empty without rows and verdicts."""
    if not run.rows and not run.judged:
        return ""
    parts = [f"## drive-robust: {_headline(run)}"]
    if run.judged:
        alpha = run.options.verdict_rule.alpha
        parts.append(_table(_VERDICT_HEADS, (_verdict(judged, alpha) for judged in run.judged)))
    reasons = [f"- {_cell(item.requirement)}: {_cell(item.message)}" for item in run.judged if item.message]
    parts += ["\n".join(reasons)] if reasons else []
    parts += [] if comparison is None else _compared(comparison)
    if run.rows:
        columns = columns_of(run)
        table = _table(("agent", "setting", *columns, "verdict"), rows_of(run, columns))
        parts.append(f"<details><summary>settings</summary>\n\n{table}\n\n</details>")
    notes = [f"- {_cell(line)}" for line in footnotes(run)]
    parts += ["\n".join(notes)] if notes else []
    return "\n\n".join(parts) + "\n\n"


def _headline(run: RunResult) -> str:
    counts = {verdict: sum(item.verdict == verdict for item in run.judged) for verdict in ("pass", *_LOUD)}
    total = len(run.judged)
    if not total:
        return "nothing was judged"
    inconclusive = total - sum(counts.values())
    parts = [f"{counts['pass']} of {total} requirements hold"]
    parts += [f"{counts['fail']} broken"] if counts["fail"] else []
    parts += [counted(counts["error"], "error")] if counts["error"] else []
    parts += [f"{inconclusive} inconclusive"] if inconclusive else []
    if run.ended_early:
        parts.append("but not all tests came to their verdicts")
    elif run.stopped_tests:
        parts.append(f"but {counted(len(run.stopped_tests), 'test')} stopped before the end")
    elif any(len(row.results) < row.needed for row in run.rows):
        parts.append("but not all episodes were driven")
    elif run.own_verdicts:
        parts.append(f"but {counted(len(run.own_verdicts), 'test')} failed for another reason")
    reading = run.options.reading
    return ", ".join(parts) + (f" (reading {reading})" if reading != READINGS[0] else "")


def _verdict(judged: Judged, alpha: float) -> tuple[str, ...]:
    """Return the row of a verdict; the interval tells its level, which depends on the rule."""
    interval = "-"
    if judged.low is not None and judged.high is not None:
        give = judged.margin or 0.0
        lenient = judged.limit + give if judged.comparison == "<=" else judged.limit - give
        ends = ends_text(judged.metric, judged.low, judged.high, judged.limit, lenient)
        interval = f"{ends} ({in_percent(confidence(judged.rule, alpha))} %)"
    routes = f"{judged.routes} of {judged.planned}" if judged.routes < judged.planned else str(judged.routes)
    return (
        judged.requirement,
        judged.agent,
        shown_beside(judged.metric, judged.value, judged.limit),
        interval,
        routes,
        f"**{judged.verdict}**" if judged.verdict in _LOUD else judged.verdict,
    )


def _compared(comparison: Comparison) -> list[str]:
    """Return the conclusion, the settings with a changed score before and after, and the routes that newly go wrong."""
    parts = [f"### {_cell(conclusion(comparison))}"]
    cells = [] if comparison.refusals else [cell for cell in comparison.cells if cell.changed or cell.regressed]
    if cells:
        pairs = [head for metric in _METRICS for head in (f"{metric} before", "after")]
        heads = ("agent", "setting", *pairs, "routes", "verdict")
        parts.append(_table(heads, map(_before_and_after, cells)))
    broken = [(cell, flip.before, flip.after) for cell in cells for flip in cell.flips if flip.fails]
    lines = [
        f"- {_cell(f'{after.route_id} {after.scenario} under {cell.setting}: was {before.ds:.1f}, {before.outcome}')}; "
        f"is {_cell(f'{after.ds:.1f}, {after.outcome}')}"
        for cell, before, after in broken[:_MOST_FLIPS]
    ]
    lines += [f"- and {len(broken) - _MOST_FLIPS} more"] if len(broken) > _MOST_FLIPS else []
    return [*parts, "\n".join(("newly going wrong:\n", *lines))] if lines else parts


def _before_and_after(cell: CellComparison) -> tuple[str, ...]:
    sides = (cell.before, cell.after)
    numbers = (shown(metric, getattr(side, metric.lower())) for metric in _METRICS for side in sides)
    verdict = f"**{cell.verdict}**" if cell.regressed else cell.verdict
    return cell.agent, cell.setting, *numbers, f"{cell.changed} of {cell.routes} changed", verdict


def _table(heads: tuple[str, ...], rows: Iterable[Iterable[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *([_cell(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """Return the text as one line, escaped so that it cannot end a cell, begin a tag, mention a user or be markup."""
    text = " ".join(text.split())
    for sign, written in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("@", "&#64;")):
        text = text.replace(sign, written)
    return text if text.startswith("**") else re.sub(r"[\\|*_`\[]", r"\\\g<0>", text)
