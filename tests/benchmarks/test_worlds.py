"""`benchmarks/worlds.py`: the same drives in two worlds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from made_up_drives import ALIKE, report, saved

ROOT = Path(__file__).parents[2]


def compared(*files: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "benchmarks" / "worlds.py"), *map(str, files)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def rows(output: str) -> dict[str, list[str]]:
    """The cells of each agent's first line."""
    cells = [[cell.strip() for cell in line.strip("│").split("│")] for line in output.splitlines() if "│" in line]
    return {row[0]: row[1:] for row in cells if row[0]}


def episode(drives: dict[str, Any], route: str, setting: str) -> dict[str, Any]:
    found: dict[str, Any] = next(
        one for one in drives["episodes"] if one["route_id"] == route and one["setting"] == setting
    )
    return found


def test_it_counts_episodes_scores_and_successes(tmp_path: Path) -> None:
    older, newer = report("tcp", ALIKE), report("tcp", ALIKE)
    newer["versions"]["simulator"] = "made-up 2"
    episode(newer, "101", "occlusion 0.5").update(driving_score=55.0, success=False)  # was 95.0, a success
    episode(newer, "201", "clean").update(driving_score=71.0)
    done = compared(*saved(tmp_path, older, newer))
    assert done.returncode == 0, done.stderr
    assert "made-up 1 -> made-up 2" in done.stdout
    # 12 settings x 8 routes; RD was 0: clean 599 -> 598, occlusion 599 -> 559
    assert rows(done.stdout)["tcp"] == ["96", "2", "74.88 -> 74.45", "1", "0.065, occlusion 0.5"]
    assert rows(done.stdout)["all"][:4] == ["96", "2", "74.88 -> 74.45", "1"]


def test_what_one_file_lacks_is_left_out(tmp_path: Path) -> None:
    fewer = report("tcp", {"clean": 1.0}, routes=3)
    done = compared(*saved(tmp_path, report("tcp", ALIKE), fewer))
    assert rows(done.stdout)["tcp"] == ["3", "0", "71.67 -> 71.67", "0", "-"]


def test_nothing_is_lost_where_clean_drives_have_no_score(tmp_path: Path) -> None:
    older, newer = (report("tcp", {"clean": 1.0, "occlusion 0.5": 0.5}, routes=3) for _ in range(2))
    newer["fingerprint"]["routes"].update({"201": "another", "301": "another"})  # 101 alone is shared
    for drives in (older, newer):
        episode(drives, "101", "clean").update(driving_score=0.0, success=False)
    done = compared(*saved(tmp_path, older, newer))
    assert rows(done.stdout)["tcp"] == ["2", "0", "23.75 -> 23.75", "0", "-"]


@pytest.mark.parametrize("changed", ["weights", "stop", "route", "setting"])
def test_other_drives_are_refused(tmp_path: Path, changed: str) -> None:
    older, newer = report("tcp", ALIKE), report("tcp", ALIKE)
    if changed == "weights":
        newer["fingerprint"]["agents"]["tcp"]["weights"] = "cc"
        said = "tcp was driven as tcp (weights bb, stopped after 30.0 s) and as tcp (weights cc, stopped after 30.0 s)"
    elif changed == "stop":
        newer["settings"]["stuck_stop_s"] = 45.0
        said = "tcp was driven as tcp (weights bb, stopped after 30.0 s) and as tcp (weights bb, stopped after 45.0 s)"
    elif changed == "setting":
        older, newer = report("tcp", {"clean": 1.0}), report("tcp", {"0 ms latency (reading=released)": 1.0})
        said = "no agent under the same setting"
    else:
        newer["fingerprint"]["routes"] = dict.fromkeys(newer["fingerprint"]["routes"], "another")
        said = "the files share no route of the same definition"
    done = compared(*saved(tmp_path, older, newer))
    assert (done.returncode, done.stdout) == (1, "")
    assert said in done.stderr
