"""Makes runs for folders of pages, and reads such a folder as a browser would: data by its scripts, motion by bytes."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from result_factory import scored

from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.pages.motion import VERSION
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Used

SETTING = "200 ms latency"

# views of the report that `tests/browser` drives
AGENT = "follower%3AFollower"
REQUIREMENT = f"#/requirement/{AGENT}/RD%20under%20GPS%20noise%2015%20m%20%3C%3D%200.01"
EPISODE = f"#/episode/{AGENT}/GPS%20noise%2015%20m/2301/0?t=4.0"
VIEWS = ("#/", REQUIREMENT, "#/failures", "#/episodes", EPISODE, "#/compare")


def data_of(folder: Path, name: str = "run") -> Any:
    """Return the plain data of `data/NAME.js`."""
    text = (folder / "data" / f"{name}.js").read_text(encoding="ascii")
    begin, end = f'driveRobust.give("{name}", ', ");\n"
    assert text.startswith(begin)
    assert text.endswith(end)
    return json.loads(text[len(begin) : -len(end)])


def motion_of(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the tables of an episode's ego and of what it was told, as `report/pages/motion.py` describes them."""
    raw = zlib.decompress(base64.b64decode(text))
    version, every, rows, told = np.frombuffer(raw[:16], "<u4").tolist()
    assert version == VERSION
    assert every == 2
    ego, place = _table(raw, 16, rows, 8)
    given, end = _table(raw, place, told, 5)
    assert end == len(raw)
    ego[:, :2] = np.cumsum(ego[:, :2], axis=0)
    return np.cumsum(ego, axis=0), np.cumsum(given, axis=0)


def _table(raw: bytes, place: int, rows: int, width: int) -> tuple[np.ndarray, int]:
    size = 4 * rows * width
    planes = np.frombuffer(raw[place : place + size], np.uint8).reshape(width, 4, rows).astype(np.int64)
    zigzag = sum(planes[:, number] << (8 * number) for number in range(4))
    return ((zigzag >> 1) ^ -(zigzag & 1)).T, place + size


def document(*results, judged=(), spec="one-per-scenario", options=None):
    """Return the document of a run that holds these results, and what finds them."""
    found = {f"{n}": result for n, result in enumerate(results)}
    groups: dict[tuple[str, str], list[str]] = {}
    for key, result in found.items():
        groups.setdefault((result.episode.agent, result.episode.setting), []).append(key)
    needed = [EpisodesNeeded(agent, spec, setting, (0,), tuple(keys)) for (agent, setting), keys in groups.items()]
    events = [*needed, Used(tuple(found)), *judged]
    run = RunResult.of(options or RunOptions(simulator="embedded"), events, found.get, versions={"numpy": "2"})
    return run_as_json(run), found.get


def records(*results, **given):
    return RunRecords.of(*document(*results, **given), default_registry(), label="a run")


def evidence():
    """Return a run with one requirement on RD, judged on twelve routes."""
    routes = resolve_routes("one-per-scenario")
    order = planned_order([r.id for r in routes], [r.scenario.type for r in routes], "driver")[:12]
    clean = [scored(route_id, 100.0) for route_id in order]
    perturbed = [scored(name, 50.0 + 4.0 * n, setting=SETTING) for n, name in enumerate(order)]
    value = 1.0 - sum(50.0 + 4.0 * n for n in range(12)) / 1200.0
    judged = Judged("test.py::t", f"RD under {SETTING} <= 0.2", "driver", "one-per-scenario", (0,), "RD", SETTING,
                    "<=", 0.2, "fail", value, 0.1, 0.4, 12, planned=44, rule="evidence")  # fmt: skip
    return order, judged, records(*clean, *reversed(perturbed), judged=[judged])
