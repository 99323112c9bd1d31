"""The totals of official results as a table with footnotes, and as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pytest_drive_robust.bench2drive.results.official_totals import AbilityRate, OfficialTotals
from pytest_drive_robust.bench2drive.results.safe_json import printable
from pytest_drive_robust.errors import first_few
from pytest_drive_robust.report.numbers import counted

_MOST_IDS = 30


def score_as_json(score: OfficialTotals, notes: tuple[str, ...]) -> dict[str, Any]:
    """Return the totals as plain JSON types, numbers in full."""
    fields = asdict(score)
    fields["abilities"] = {name: _rate_json(rate) for name, rate in score.abilities.items()}
    fields["mean_ability"] = _rate_json(score.mean_ability)
    return {"metrics": fields.pop("mode"), **fields, "notes": notes}


def _rate_json(rate: AbilityRate) -> dict[str, float | int | None]:
    return {"value": rate.value, **asdict(rate)}


def score_text(score: OfficialTotals, notes: tuple[str, ...], *, source: str) -> str:
    """Return the totals with their footnote numbers, the statuses, the missing routes, and the footnotes."""
    records = f"{counted(score.records, 'record')} of {counted(score.routes, 'route')}"
    lines = [f"{printable(source, quotes=False)}: {records}, {score.mode} metrics", ""]
    for name, value, unit in (
        ("DS", score.ds, ""),
        ("SR", score.sr, ""),
        ("efficiency", score.efficiency, " %"),
        ("comfort", score.comfort, " %"),
    ):
        text = "-" if value is None else f"{value:.4f}{unit}"
        lines.append(f"{name:<18}{text} {_marks((name,), notes)}".rstrip())
    for name, rate in {**score.abilities, "mean of abilities": score.mean_ability}.items():
        over = "" if name not in score.abilities else f"  of {counted(rate.routes, 'route')}"
        lines.append(f"{name:<18}{_rate_text(rate)}{over} {_marks((name, 'abilities'), notes)}".rstrip())
    lines.append("")
    lines += [f"{count:>5}  {status}" for status, count in score.statuses.items()]
    lines += _gaps(score)
    if notes:
        lines.append("")
        lines += [f"[{number}] {note}" for number, note in enumerate(notes, start=1)]
    return "\n".join(lines)


def _rate_text(rate: AbilityRate) -> str:
    if rate.low is None or rate.high is None:
        return "-"
    low, high = f"{100.0 * rate.low:.2f}", f"{100.0 * rate.high:.2f}"
    return f"{low} %" if rate.value is not None else f"{low} to {high} %"


def _gaps(score: OfficialTotals) -> list[str]:
    lines = []
    if score.missing:
        lines.append(f"{len(score.missing):>5}  missing: {first_few(score.missing, _MOST_IDS)}")
    elif score.missing_count:
        lines.append(f"{score.missing_count:>5}  missing (--routes FILE.xml tells which)")
    if score.duplicates:
        ids = [printable(route_id, quotes=False) for route_id in score.duplicates]
        lines.append(f"{len(ids):>5}  there more than once: {first_few(ids, _MOST_IDS)}")
    return lines


def _marks(names: tuple[str, ...], notes: tuple[str, ...]) -> str:
    """Return the numbers of the footnotes on a line, such as `"[1][4]"`."""
    about = [set(note.partition(":")[0].split(", ")) for note in notes]
    return "".join(f"[{number}]" for number, topics in enumerate(about, start=1) if topics & {*names, "all"})
