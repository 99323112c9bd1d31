"""Read and write `metric_info.json` of a route: the motion that an agent logs in each step, in CARLA's world frame.

Bench2Drive `leaderboard/autoagents/autonomous_agent.py`, `get_metric_info`: y to the right of x, yaw clockwise;
accelerations in m/s2, angular velocities in degrees per second, rotations as roll, pitch, yaw in degrees.

The file has no times: a step is the number of a call of `run_step`. Under a latency with `mode=hold`, as in the
released code, calls are several ticks apart; the duration of the drive tells how many.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.bench2drive.results.safe_json import finite, printable, read_json
from pytest_drive_robust.domain.result import Trace, read_only
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.metrics.comfort import COMFORT_QUIRKS, Motion, comfort_of
from pytest_drive_robust.store.episode_fields import NO_TICKS

FILE_NAME = "metric_info.json"
LONGEST_S = 1e9
"""Longest duration in seconds that is turned into ticks: a record may tell any duration."""
TICK_S = 0.05
"""Seconds per tick of the official evaluator (Bench2Drive `leaderboard/leaderboard_evaluator.py`, `frame_rate`)."""
_VECTORS = ("acceleration", "angular_velocity", "forward_vector", "right_vector", "location", "rotation")
_WIDTH = 3 * len(_VECTORS)


def _first_log(folders: Sequence[Path], record: OfficialRecord) -> Path | None:
    return next((path for folder in folders if (path := find_log(folder, record.save_name)) is not None), None)


def find_log(folder: Path, save_name: str) -> Path | None:
    """Return the path of a record's log, or None without a log.

    The log is in the folder `save_name`, or in the only folder whose name ends with `_` and `save_name`.
    """
    if not save_name or Path(save_name).name != save_name or "\0" in save_name or save_name in (".", ".."):
        return None
    try:
        exact = folder / save_name / FILE_NAME
        if exact.is_file():
            return exact
        renamed = [
            item / FILE_NAME
            for item in folder.iterdir()
            if item.name.endswith(f"_{save_name}") and (item / FILE_NAME).is_file()
        ]
    except (OSError, ValueError):
        return None
    return renamed[0] if len(renamed) == 1 else None


@dataclass(frozen=True, slots=True)
class _Log:
    """The samples of a log, (samples, 18): the six vectors of a sample in a row. `dt_s` is the time between samples.

    `as_written` has the order of the file, as the official tool reads it; `in_order` is sorted by step.
    """

    as_written: Floats
    in_order: Floats
    dt_s: float


def _read_log(path: Path, record: OfficialRecord) -> _Log:
    """Read the log of a record. Raises `UsageError` for a damaged file."""
    document = read_json(path)
    if not isinstance(document, dict):
        raise UsageError(f"{printable(path)} is not a log of motion: expected an object with one entry for each step.")
    rows = np.array(
        [_row(given, f"{printable(path)}, step {printable(step)}") for step, given in document.items()],
        dtype=np.float64,
    ).reshape(len(document), _WIDTH)
    steps = [int(step) for step in document if step.isascii() and step.isdigit() and len(step) < 10]
    known = np.array(steps, dtype=np.int64)
    if len(known) < len(document) or len(known) < 2:
        return _Log(rows, rows, TICK_S * _ticks_per_call(len(rows), record))
    order = np.argsort(known, kind="stable")
    calls_apart = max(float(np.median(np.diff(known[order]))), 1.0)
    return _Log(rows, rows[order], TICK_S * calls_apart * _ticks_per_call(int(known.max()) + 1, record))


def _ticks_per_call(calls: int, record: OfficialRecord) -> float:
    """Return the ticks between two calls of the agent: 1, or the mean if the agent did not run in every tick."""
    ticks = min(record.game_s, LONGEST_S) / TICK_S
    # Logs of agents that run in every tick may lack a few ticks: some agents begin later, some save every tenth.
    return ticks / max(calls, 1) if ticks > 1.1 * calls else 1.0


def _motion_from(rows: Floats, dt_s: float) -> Motion:
    """Return the planar signals from which comfort is computed, by the official projections."""
    acceleration, forward, right, place = rows[:, 0:2], rows[:, 6:8], rows[:, 9:11], rows[:, 12:14]
    moved_m = np.hypot(*np.diff(place, axis=0).T) if len(rows) > 1 else np.zeros(0)
    return Motion(
        forward_mps2=np.einsum("ij,ij->i", acceleration, forward),
        right_mps2=np.einsum("ij,ij->i", acceleration, right),
        magnitude_mps2=np.hypot(acceleration[:, 0], acceleration[:, 1]),
        yaw_rate_radps=np.radians(rows[:, 5]),
        speed_mps=np.concatenate((moved_m[:1], moved_m)) / dt_s if len(moved_m) else np.zeros(len(rows)),
        dt_s=dt_s,
    )


def logged_trace(record: OfficialRecord, folders: Sequence[Path]) -> Trace:
    """Return the trace in the log of a record; controls and progress are 0.

    The trace is empty without a log, and for a log that lacks ticks, because readers of a trace take each row for a
    tick.
    """
    path = _first_log(folders, record)
    if path is None:
        return NO_TICKS
    log = _read_log(path, record)
    if record.own is None and log.dt_s > TICK_S:  # our exports hold every tick, whose length may differ from TICK_S
        return NO_TICKS
    rows = log.in_order
    motion = _motion_from(rows, log.dt_s)
    columns = np.zeros((len(rows), len(Trace.COLUMNS)))
    columns[:, 0:2] = rows[:, 12:14]
    columns[:, 2] = np.radians(rows[:, 17])
    columns[:, 3:7] = np.stack(
        (motion.speed_mps, motion.forward_mps2, motion.right_mps2, motion.yaw_rate_radps), axis=1
    )
    return Trace(read_only(columns))


class Comforts:
    """The comfort of records whose motion was logged in one of `folders`; each log is read once."""

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = folders
        self._motions: dict[Path, tuple[Motion, Motion]] = {}

    def value(self, record: OfficialRecord, mode: str) -> float | None:
        """Return the comfort in percent, None without a log or with too few samples. Raises `UsageError` if damaged."""
        return self.with_quirks(record, COMFORT_QUIRKS if mode == "bench2drive" else ())

    def with_quirks(self, record: OfficialRecord, quirks: tuple[str, ...]) -> float | None:
        """Return `value` with some of the quirks. With any quirk the samples are in the order of the file."""
        path = self.path(record)
        if path is None:
            return None
        if path not in self._motions:
            log = _read_log(path, record)
            self._motions[path] = _motion_from(log.as_written, log.dt_s), _motion_from(log.in_order, log.dt_s)
        return comfort_of(self._motions[path][0 if quirks else 1], quirks)

    def path(self, record: OfficialRecord) -> Path | None:
        """Return the path of a record's log, or None without a log."""
        return _first_log(self._folders, record)

    def is_renamed(self, record: OfficialRecord) -> bool:
        """Return True when the log's folder is not called `save_name`, so that the official tool does not find it."""
        path = self.path(record)
        return path is not None and path.parent.name != record.save_name


def log_text(trace: Trace) -> str:
    """Return the text of a trace's log. The official tools get its planar signals back to the last bits of a double."""
    yaw = trace.column("yaw_rad")
    cos, sin, flat = np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))
    forward, right = trace.column("forward_mps2"), trace.column("right_mps2")
    vectors = {
        "acceleration": (forward * cos - right * sin, forward * sin + right * cos, flat),
        "angular_velocity": (flat, flat, np.degrees(trace.column("yaw_rate_radps"))),
        "forward_vector": (cos, sin, flat),
        "right_vector": (-sin, cos, flat),
        "location": (trace.column("x_m"), trace.column("y_m"), flat),
        "rotation": (flat, flat, np.degrees(yaw)),
    }
    columns = {name: np.stack(parts, axis=1).tolist() for name, parts in vectors.items()}
    steps = {str(step): {name: columns[name][step] for name in _VECTORS} for step in range(len(trace.rows))}
    return json.dumps(steps, allow_nan=False) + "\n"


def _row(given: object, where: str) -> list[float]:
    row: list[float] = []
    for name in _VECTORS:
        vector = given.get(name) if isinstance(given, dict) else None
        if not isinstance(vector, list) or len(vector) != 3:
            raise UsageError(f"{where}: {name} is {printable(vector)}, expected a list of three numbers.")
        for value in vector:
            number = finite(value)
            if number is None:
                raise UsageError(f"{where}: {name} holds {printable(value)}, expected a finite number.")
            row.append(number)
    return row
