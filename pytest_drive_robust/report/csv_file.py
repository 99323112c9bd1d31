"""The episodes of a run as CSV for spreadsheets and data frames: one line per episode, columns in a fixed order."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.report.json_file import episode_as_json
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.whole_file import write_whole
from pytest_drive_robust.verdict.explain import infraction_s

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
"""The columns; add new ones at the end. `infractions` and `touched` hold names separated by spaces."""


def write_csv(path: Path, run: RunResult) -> None:
    """Write the episodes to `path`, which is either untouched or whole."""
    write_whole(path, csv_text(run))


def csv_text(run: RunResult) -> str:
    """Return a header and one line for each episode, in the order of the run; a missing number is an empty cell."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for key, result in run.episodes.items():
        fields = {**episode_fields(result), "key": key}
        writer.writerow([fields[column] for column in COLUMNS])
    return legible(stream.getvalue(), controls=True)


def episode_fields(result: EpisodeResult) -> dict[str, object]:
    """Return the columns of an episode except `key`, by name; None for a missing number."""
    facts = episode_as_json("", result)
    success = facts["success"]
    events = sorted(result.infractions, key=lambda event: event.tick)
    first_s = infraction_s(events[0], result.dt_s) if events else None
    touched = () if result.reception is None else result.reception.touched
    return {
        **{name: facts[name] for name in COLUMNS if name in facts and name != "key"},
        "success": None if success is None else int(bool(success)),
        "infractions": " ".join(event.kind.value for event in events),
        "first_infraction_s": None if first_s is None else round(first_s, 6),
        "touched": " ".join(touch.signal for touch in touched),
        "game_s": round(result.game_s, 6),
    }
