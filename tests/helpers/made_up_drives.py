"""Reports of made-up drives, with what `benchmarks/paper.py` reads of a report of `--drive-json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from _paper import joining, results
from _paper.published import CLEAN, PUBLISHED, SETTINGS
from _paper.readings import NO_LATENCY, READINGS, Drives, called_in

CLEAN_DS = (95.0, 72.0, 48.0, 95.0, 90.0, 64.0, 80.0, 55.0)
"""Clean driving scores of the routes 101, 201, ..."""

ALIKE = dict.fromkeys((CLEAN, *SETTINGS), 1.0)
"""The reading `paper` alone."""


def report(
    agent: str,
    share_of: Mapping[str, float],
    *,
    efficiency_of: Mapping[str, float] | None = None,
    comfort_of: Mapping[str, float] | None = None,
    routes: int = len(CLEAN_DS),
) -> dict[str, Any]:
    """Report an agent whose driving score on every route is that of `CLEAN_DS` times the share of the setting.

    `efficiency_of` is percent, by setting, 100 when left out; the last route has no data on it. `comfort_of` is
    percent, by setting, 30 when left out.
    """
    fast = efficiency_of or dict.fromkeys(share_of, 100.0)
    smooth = comfort_of or dict.fromkeys(share_of, 30.0)
    episodes = [
        {
            "agent": agent,
            "route_id": str(100 * place + 101),
            "scenario": f"Type{place}",
            "setting": setting,
            "driving_score": min(100.0, share * CLEAN_DS[place]),
            "success": share * CLEAN_DS[place] >= 90.0,
            "versions": {"machine torch": "0123"},
            "speed_ratios_pct": [] if place == routes - 1 else [fast[setting] - place, fast[setting] + place, 5000.0],
        }
        for setting, share in share_of.items()
        for place in range(routes)
    ]
    return {
        "schema": 1,
        "settings": {"seeds": [0], "metrics": "bench2drive", "stuck_stop_s": 30.0},
        "versions": {"simulator": "made-up 1"},
        "fingerprint": {
            "agents": {agent: {"distribution": "none 1.0", "source": "aa", "weights": "bb"}},
            "routes": {str(100 * place + 101): f"digest{place}" for place in range(routes)},
        },
        "summaries": [
            {"agent": agent, "setting": setting, "summary": {"episodes": routes, "comfort": smooth[setting]}}
            for setting in share_of
        ],
        "episodes": episodes,
    }


def saved(folder: Path, *reports: Mapping[str, Any]) -> Sequence[Path]:
    """Write one file for each."""
    paths = [folder / f"{number}.json" for number in range(len(reports))]
    for path, content in zip(paths, reports, strict=True):
        path.write_text(json.dumps(content), encoding="utf-8")
    return paths


def as_published(agent: str) -> dict[str, Any]:
    """A report that has the paper's own figures in both readings, without noise."""
    best = PUBLISHED["simlingo"][CLEAN].ds
    rows = {called_in(reading, row): figures for reading in READINGS for row, figures in PUBLISHED[agent].items()}
    rows[called_in("released", NO_LATENCY)] = PUBLISHED[agent][CLEAN]
    return report(
        agent,
        {setting: row.ds / best for setting, row in rows.items()},
        efficiency_of={setting: row.efficiency for setting, row in rows.items()},
        comfort_of={setting: row.comfort for setting, row in rows.items()},
    )


def of_shares(folder: Path, shares: Mapping[str, Mapping[str, float]]) -> results.Results:
    """Return what `joining` reads of a `report` of each agent, saved in `folder`."""
    return joining.read(saved(folder, *(report(agent, of) for agent, of in shares.items())))


def paper_reading(folder: Path, shares: Mapping[str, Mapping[str, float]]) -> Drives:
    """Return the drives of `of_shares` in the reading `paper`."""
    return Drives(of_shares(folder, shares), READINGS[0])
