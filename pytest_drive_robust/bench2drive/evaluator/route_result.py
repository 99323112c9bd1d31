"""The result of one route in the official evaluator, and whether it tells about the agent."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.evaluator.attempt import Attempt
from pytest_drive_robust.bench2drive.evaluator.injection_log import Injected, injected_in
from pytest_drive_robust.bench2drive.evaluator.run_folder import RunFolder
from pytest_drive_robust.bench2drive.evaluator.setup import INJECTED_LOG
from pytest_drive_robust.bench2drive.results.official_record import STATUSES, OfficialRecord
from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.bench2drive.results.safe_json import printable
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.store.reuse import RAN_OUT

_SERVER_LOST = "while waiting for the simulator"
"""Part of the message of every call of CARLA's client when the server is gone."""
_RAN_OUT = re.compile(
    rf"(?:could not set up the required agent|the agent has crashed):.*?({'|'.join(RAN_OUT)})",
    re.IGNORECASE | re.DOTALL,
)
"""Matches the evaluator's report of an agent's exception that is about lack of resources."""


@dataclass(frozen=True, slots=True)
class DrivenRoute:
    """The result of a route. `record` is None when no try gave a score; `troubles` has a text for each failed try."""

    route: str
    record: OfficialRecord | None
    troubles: tuple[str, ...]
    injected: Injected
    wall_s: float


def read_finished(run_folder: RunFolder, route: str, setting: Setting, seed: int) -> DrivenRoute | None:
    """Return an earlier run's result of a route, None if there is none. Raises `UsageError` for a damaged file."""
    path = run_folder.result(route)
    if not path.is_file():
        return None
    record, trouble = record_in(path, route, Attempt(0, "", 0.0))
    injected = injected_in(run_folder.injected(route), route=route, setting=str(setting), seed=seed)
    if record is not None and not was_injected(setting, record, injected):
        told = f"{str(run_folder.injected(route))!r} does not tell that {str(setting)!r} was injected"
        trouble, record = told, None
    if record is None:
        raise UsageError(f"{str(path)!r} is not a finished result: {trouble}. Remove it to drive the route again.")
    return DrivenRoute(route, record, (), injected, record.wall_s)


def record_in(path: Path, route: str, ended: Attempt) -> tuple[OfficialRecord | None, str]:
    """Return the record and an empty text, or None and why there is no record that tells about the agent."""
    told = ended.trouble or f"the evaluator ended with exit code {ended.code}"
    if not path.is_file() or path.stat().st_size == 0:
        return None, f"{told} and wrote no result"
    try:
        records = [record for record in read_results(path).records if record.route == route]
    except UsageError as error:
        return None, f"{told}: {str(error).replace(printable(path), 'its result')}"  # that file is removed
    if len(records) != 1:
        return None, f"{told} with {len(records)} records of the route, expected one"
    (record,) = records
    if record.is_harness_error:
        return None, f"{told}: {record.status}"
    return record, ""


def excuse_of(record: OfficialRecord, ended: Attempt, log: Path) -> str:
    """Return why an agent error says nothing about the agent; empty where it does.

    The agent called a dead server, or the machine ran out of memory, disk, files or threads.
    """
    if STATUSES[record.status][0] is not Outcome.AGENT_ERROR:
        return ""
    told = log.read_text(encoding="utf-8", errors="replace")
    found = _RAN_OUT.search(told)
    if found:
        return f"for want of memory, room on a disk, files or threads ({found[1]})"
    return "after the CARLA server was lost" if ended.trouble or _SERVER_LOST in told else ""


def keep_files(run_folder: RunFolder, route: str) -> None:
    """Keep the files of a try. Move the result last: a route with a result counts as finished."""
    log = run_folder.work(route) / INJECTED_LOG
    if log.is_file():
        os.replace(log, run_folder.injected(route))
    else:
        run_folder.injected(route).unlink(missing_ok=True)  # the log of the result that is replaced
    os.replace(run_folder.work(route) / "result.json", run_folder.result(route))


def was_injected(setting: Setting, record: OfficialRecord, injected: Injected) -> bool:
    """Return True if the setting is clean, or it reached the agent, or the agent broke, perhaps before a first tick."""
    broke = STATUSES[record.status][0] is Outcome.AGENT_ERROR
    return setting.is_clean or broke or injected.injected_ticks > 0
