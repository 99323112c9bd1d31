"""The run as a GitHub step summary: what a pull request shows without opening a log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.perturbations.readings import READINGS
from pytest_drive_robust.report.numbers import interval_text, legible, shown
from pytest_drive_robust.report.terminal import columns_of, footnotes, numbers_of

if TYPE_CHECKING:
    from pytest_drive_robust.report.run_result import RunResult, SettingRow
    from pytest_drive_robust.store.events import Judged

__all__ = ["VARIABLE", "append_step_summary", "step_summary"]

VARIABLE = "GITHUB_STEP_SUMMARY"
"""Where GitHub Actions says which file to append to."""

_LOUD = ("fail", "error")
_VERDICT_HEADS = ("requirement", "agent", "value", "interval", "routes", "verdict")


def append_step_summary(run: RunResult, environ: Mapping[str, str]) -> None:
    """Append the summary to the file that the environment names; without one nothing happens. Raises `OSError`."""
    path = environ.get(VARIABLE, "")
    if not path:
        return
    text = step_summary(run)
    if text:
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(legible(text))


def step_summary(run: RunResult) -> str:
    """Return as Markdown the verdicts, the table of settings, the footnotes. Empty when nothing was asked for."""
    if not run.rows and not run.judged:
        return ""
    parts = [f"## drive-robust: {_headline(run)}"]
    if run.judged:
        parts.append(_table(_VERDICT_HEADS, map(_verdict, run.judged)))
    reasons = [f"- {_cell(item.requirement)}: {_cell(item.message)}" for item in run.judged if item.message]
    parts += ["\n".join(reasons)] if reasons else []
    if run.rows:
        columns = columns_of(run)
        table = _table(("agent", "setting", *columns, "verdict"), (_setting(row, columns) for row in run.rows))
        parts.append(f"<details><summary>settings</summary>\n\n{table}\n\n</details>")
    notes = [f"- {_cell(line)}" for line in footnotes(run)]
    parts += ["\n".join(notes)] if notes else []
    return "\n\n".join(parts) + "\n\n"


def _headline(run: RunResult) -> str:
    counts = {verdict: sum(item.verdict == verdict for item in run.judged) for verdict in ("pass", *_LOUD)}
    total = len(run.judged)
    if not total:
        return "nothing was judged"
    open_ = total - sum(counts.values())
    parts = [f"{counts['pass']} of {total} requirements hold"]
    parts += [f"{counts['fail']} broken"] if counts["fail"] else []
    parts += [f"{counts['error']} not judged"] if counts["error"] else []
    parts += [f"{open_} open"] if open_ else []
    reading = run.options.reading
    return ", ".join(parts) + (f" (reading {reading})" if reading != READINGS[0] else "")


def _verdict(judged: Judged) -> tuple[str, ...]:
    interval = "-"
    if judged.low is not None and judged.high is not None:
        interval = interval_text(judged.metric, judged.low, judged.high).partition("interval ")[2]
    routes = f"{judged.routes} of {judged.planned}" if judged.routes < judged.planned else str(judged.routes)
    return (
        judged.requirement,
        judged.agent,
        shown(judged.metric, judged.value),
        interval,
        routes,
        f"**{judged.verdict}**" if judged.verdict in _LOUD else judged.verdict,
    )


def _setting(row: SettingRow, columns: tuple[str, ...]) -> tuple[str, ...]:
    return (row.agent + ("*" if row.privileged else ""), row.setting, *numbers_of(row, columns), row.verdict)


def _table(heads: tuple[str, ...], rows: Iterable[Iterable[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *([_cell(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """Return the text as one line, in which nothing ends a cell, begins a tag or is taken for a footnote's star."""
    text = " ".join(text.split())
    for sign, written in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|")):
        text = text.replace(sign, written)
    return text if text.startswith("**") else text.replace("*", "\\*")
