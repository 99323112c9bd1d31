"""A run as tidy tables: columns by name, units in the names, one row per episode, tick, infraction or verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import Given, Trace
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.report.csv_file import COLUMNS, episode_fields
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.store.events import Judged
from pytest_drive_robust.verdict.explain import infraction_s

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.results.run import Run

Columns = Mapping[str, Sequence[Any]]

_NAMES = ("key", "agent", "setting", "route_id", "seed")
_TOLD = {"gps_x_m": "told_x_m", "gps_y_m": "told_y_m", "heading_rad": "told_heading_rad", "speed_mps": "told_speed_mps"}


def columns_of(run: Run, table: str) -> Columns:
    """Return the columns of a table of a run. Raises `UnknownNameError` for another table."""
    if table not in TABLES:
        raise UnknownNameError.of("table", table, TABLES)
    return TABLES[table](run)


def _episodes(run: Run) -> Columns:
    """Return the columns of `--drive-csv`, then the clean twin's key and more facts and metrics of the episode."""
    return _from_rows([_episode(run, result) for result in run.episodes], (*COLUMNS, *_MORE))


_MORE = ("clean_key", "route_length_m", "efficiency_pct", "comfort_pct", "end_detail", "ticks", "privileged")


def _episode(run: Run, result: EpisodeResult) -> dict[str, Any]:
    twin, mode = run.twin(result), run.options["metrics"]
    row = episode_fields(result)
    scored = result.outcome is not Outcome.INFRA_ERROR
    return {
        **row,
        "success": None if row["success"] is None else bool(row["success"]),
        "key": run.key(result),
        "clean_key": None if twin is None else run.key(twin),
        "route_length_m": float(result.route_length_m),
        "efficiency_pct": efficiency(result, mode=mode) if scored else None,
        "comfort_pct": comfort(result, mode=mode) if scored and len(result.trace.rows) else None,
        "end_detail": result.end_detail,
        "ticks": result.ticks,
        "privileged": result.privileged,
    }


def _infractions(run: Run) -> Columns:
    """Return one row per infraction, with its tick as counted in the table of ticks; None when the tick is unknown."""
    rows = [
        {
            **_names(run, result),
            "kind": item.kind.value,
            "tick": None if second is None else item.tick - 1,
            "time_s": None if second is None else round(second, 6),
            "x_m": float(item.x_m),
            "y_m": float(item.y_m),
            "share_pct": float(item.share_pct),
            "detail": item.detail,
        }
        for result in run.episodes
        for item in result.infractions
        for second in [infraction_s(item, result.dt_s)]
    ]
    return _from_rows(rows, (*_NAMES, "kind", "tick", "time_s", "x_m", "y_m", "share_pct", "detail"))


def _requirements(run: Run) -> Columns:
    rows = [{**asdict(item), "seeds": " ".join(map(str, item.seeds))} for item in run.requirements]
    return _from_rows(rows, tuple(item.name for item in fields(Judged)))


def _ticks(run: Run) -> Columns:
    """Return the ego at the end of each tick, and the values given to the agent in the tick; NaN without any."""
    driven = [result for result in run.episodes if len(result.trace.rows)]
    names = [_names(run, result) for result in driven]
    counts = [len(result.trace.rows) for result in driven]
    ticks = [np.arange(count) for count in counts]
    columns: dict[str, Any] = {
        name: np.repeat(np.array([row[name] for row in names], int if name == "seed" else object), counts)
        for name in _NAMES
    }
    columns["tick"] = _joined(ticks, int)
    columns["time_s"] = _joined([(row + 1) * result.dt_s for row, result in zip(ticks, driven, strict=True)])
    for name in Trace.COLUMNS:
        columns[name] = _joined([result.trace.column(name) for result in driven])
    for name, told in _TOLD.items():
        columns[told] = _joined([_told(result, name, count) for result, count in zip(driven, counts, strict=True)])
    return columns


def _told(result: EpisodeResult, name: str, count: int) -> Any:
    values = np.full(count, np.nan)
    if result.given is not None:
        ticks = result.given.rows[:, Given.COLUMNS.index("tick")].astype(int)
        within = ticks < count
        values[ticks[within]] = result.given.column(name)[within]
    return values


def _joined(parts: Iterable[Any], dtype: type = float) -> Any:
    return np.concatenate([np.zeros(0, dtype), *parts])


def _names(run: Run, result: EpisodeResult) -> dict[str, Any]:
    episode = result.episode
    words = {name: legible(getattr(episode, name)) for name in ("agent", "setting", "route_id")}
    return {"key": run.key(result), **words, "seed": episode.seed}


def _from_rows(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> Columns:
    """Return rows as columns; lone surrogates, which files cannot hold, are spelled out."""
    plain = [[legible(value) if isinstance(value, str) else value for value in map(row.get, names)] for row in rows]
    return {name: [row[place] for row in plain] for place, name in enumerate(names)}


TABLES = {"episodes": _episodes, "ticks": _ticks, "infractions": _infractions, "requirements": _requirements}
"""The function that builds each table, by table name."""
