"""`benchmarks/repeated.py`: episodes that were driven again, against those of the paper's table."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from _paper import joining, results
from made_up_drives import ALIKE, report, saved

ROOT = Path(__file__).parents[2]


def compared(folder: Path, *again: dict[str, Any], table: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Compare `again` with a table of `tcp` and `vad` on eight routes."""
    if table is None:
        (folder / "table").mkdir()
        table = folder / "table.json"
        files = saved(folder / "table", report("tcp", ALIKE), report("vad", ALIKE))
        table.write_text(results.text_of(joining.read(files)), encoding="utf-8")
    command = [sys.executable, "benchmarks/repeated.py", *map(str, saved(folder, *again)), "--table", str(table)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_equal_episodes_are_equal_on_some_routes_and_settings(tmp_path: Path) -> None:
    done = compared(tmp_path, report("tcp", {"clean": 1.0, "occlusion 0.8": 1.0}, routes=8), report("vad", ALIKE))
    assert (done.returncode, done.stderr) == (0, "")
    assert "0.json: 0 of 16 episodes differ" in done.stdout
    assert "1.json: 0 of 96 episodes differ" in done.stdout


def lower_score(episode: dict[str, Any]) -> None:
    episode["driving_score"] -= 0.0002


def other_success(episode: dict[str, Any]) -> None:
    episode["success"] = not episode["success"]


def other_speed(episode: dict[str, Any]) -> None:
    episode["speed_ratios_pct"] = [50.0]


@pytest.mark.parametrize("change", [lower_score, other_success, other_speed])
def test_one_other_episode_is_named_with_both_results(tmp_path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    again = report("tcp", ALIKE)
    (episode,) = (e for e in again["episodes"] if (e["setting"], e["route_id"]) == ("GPS noise 5 m", "301"))
    change(episode)
    done = compared(tmp_path, again)
    assert done.returncode == 1
    assert "0.json: 1 of 96 episodes differ" in done.stdout
    assert "tcp, GPS noise 5 m, 301, seed 0:\n    table  DS 48.00, no success, efficiency 100.00" in done.stdout


def test_other_libraries_and_machines_are_named(tmp_path: Path) -> None:
    again = report("tcp", ALIKE)
    again["versions"]["numpy"] = "9.9"
    for episode in again["episodes"]:
        episode["versions"] = {"machine torch": "4567"}
    done = compared(tmp_path, again)
    assert done.returncode == 0
    assert "tcp: numpy 9.9, in the table not noted" in done.stdout
    assert "tcp: torch computes otherwise than on the table's machine" in done.stdout


def of_another_seed(document: dict[str, Any]) -> None:
    document["settings"]["seeds"] = [7]


def on_another_route(document: dict[str, Any]) -> None:
    document["fingerprint"]["routes"]["301"] = "changed"


def with_other_weights(document: dict[str, Any]) -> None:
    document["fingerprint"]["agents"]["tcp"]["weights"] = "cc"


def with_another_stop(document: dict[str, Any]) -> None:
    document["settings"]["stuck_stop_s"] = 45.0


def in_another_world(document: dict[str, Any]) -> None:
    document["versions"]["simulator"] = "made-up 2"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (of_another_seed, "0.json: seeds 7 not in the table, which has 8 routes and the seeds 0."),
        (on_another_route, "routes 301 have another definition than those of the table"),
        (with_other_weights, "weights cc, stopped after 30.0 s"),
        (with_another_stop, "weights bb, stopped after 45.0 s"),
        (in_another_world, "driven in {'simulator': 'made-up 2'}"),
    ],
)
def test_other_episodes_are_not_compared(tmp_path: Path, change: Callable[[dict[str, Any]], None], said: str) -> None:
    again = report("tcp", ALIKE)
    change(again)
    done = compared(tmp_path, again)
    assert done.returncode == 1
    assert said in done.stderr
    assert "episodes differ" not in done.stdout


def test_agents_settings_and_routes_outside_the_table_are_not_compared(tmp_path: Path) -> None:
    table = tmp_path / "small.json"
    (tmp_path / "small").mkdir()
    small = report("tcp", {"clean": 1.0}, routes=4)
    table.write_text(results.text_of(joining.read(saved(tmp_path / "small", small))), encoding="utf-8")
    for again, said in (
        (report("vad", {"clean": 1.0}, routes=4), "vad is not in the table"),
        (report("tcp", {"clean": 1.0, "occlusion 0.5": 1.0}, routes=4), "tcp under occlusion 0.5 is not in the table"),
        (report("tcp", {"clean": 1.0}), "routes 501, 601, 701, 801 not in the table, which has 4 routes"),
    ):
        done = compared(tmp_path, again, table=table)
        assert done.returncode == 1
        assert said in done.stderr


def test_the_committed_table_equals_itself() -> None:
    table = ROOT / "benchmarks" / "paper" / "results.json"
    command = [sys.executable, "benchmarks/repeated.py", str(table)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    episodes = sum(
        len(scores)
        for driven in json.loads(table.read_text(encoding="utf-8"))["agents"].values()
        for of in driven["settings"].values()
        for scores in of["driving_score"]
    )
    assert f"0 of {episodes} episodes differ" in done.stdout
