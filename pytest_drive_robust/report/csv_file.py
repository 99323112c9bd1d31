"""The episodes of a run for spreadsheets and data frames: one line each, in columns that never change their order."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.store.whole_file import write_whole

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.report.run_result import RunResult

__all__ = ["COLUMNS", "csv_text", "write_csv"]

COLUMNS = (
    "agent",
    "setting",
    "route_id",
    "scenario",
    "seed",
    "outcome",
    "end",
    "driving_score",
    "success",
    "route_completion_pct",
    "infractions",
    "first_infraction_s",
    "touched",
    "game_s",
    "wall_s",
    "trace_digest",
    "key",
)
"""New columns are added at the end. `infractions` and `touched` hold names with a space between them."""


def write_csv(path: Path, run: RunResult) -> None:
    """Write the episodes so that `path` is either untouched or whole."""
    write_whole(path, csv_text(run))


def csv_text(run: RunResult) -> str:
    """Return a header and one line for each episode, in the order of the run; empty where there is no number."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for key, result in run.episodes.items():
        fields = {**_fields(result), "key": key}
        writer.writerow([fields[column] for column in COLUMNS])
    return legible(stream.getvalue(), controls=True)


def _fields(result: EpisodeResult) -> dict[str, object]:
    score, success = _score(result)
    events = sorted(result.infractions, key=lambda event: event.tick)
    touched = () if result.reception is None else result.reception.touched
    return {
        "agent": result.episode.agent,
        "setting": result.episode.setting,
        "route_id": result.episode.route_id,
        "scenario": result.scenario,
        "seed": result.episode.seed,
        "outcome": result.outcome.value,
        "end": result.end.value,
        "driving_score": score,
        "success": success,
        "route_completion_pct": float(result.route_completion_pct),
        "infractions": " ".join(event.kind.value for event in events),
        "first_infraction_s": round(events[0].tick * result.dt_s, 6) if events else "",
        "touched": " ".join(touch.signal for touch in touched),
        "game_s": round(result.game_s, 6),
        "wall_s": result.wall_s,
        "trace_digest": result.trace.digest,
    }


def _score(result: EpisodeResult) -> tuple[float | str, int | str]:
    try:
        return driving_score(result), int(is_success(result))
    except ComparisonError:
        return "", ""
