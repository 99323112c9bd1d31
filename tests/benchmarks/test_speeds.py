"""`benchmarks/speeds.py`: the same figure of our reports and of official results."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from official_records import document, record, write
from speeds import drives_of, main

ROOT = Path(__file__).parents[2]


def ours(tmp_path: Path, seconds: list[float], outcomes: list[str], *, first: int = 1) -> Path:
    """Routes of 100 m, clean, and one under a failure that must not count; `first` is the id of the first route."""
    episodes = [
        {
            "agent": "made-up", "setting": "clean", "outcome": outcome, "ticks": round(20 * game_s), "game_s": game_s,
            "route_length_m": 100.0, "route_id": str(route), "seed": 0,
        }
        for route, (game_s, outcome) in enumerate(zip(seconds, outcomes, strict=True), first)
    ]  # fmt: skip
    episodes.append({**episodes[0], "setting": "occlusion 0.5", "game_s": 1.0})
    path = tmp_path / "ours.json"
    path.write_text(json.dumps({"schema": 1, "episodes": episodes}), encoding="utf-8")
    return path


def official(tmp_path: Path) -> Path:
    ends = [("Completed", 10.0), ("Perfect", 20.0), ("Completed", 40.0), ("Failed - TickRuntime", 200.0)]
    records = [
        record(str(number), status=status) | {"meta": {"route_length": 100.0, "duration_game": s, "duration_system": s}}
        for number, (status, s) in enumerate(ends)
    ]
    return write(tmp_path / "theirs.json", document(*records))


def test_metres_per_second_of_the_completed_routes(tmp_path: Path) -> None:
    outcomes = ["completed", "completed", "completed", "failed", "infra_error"]
    files = [ours(tmp_path, [10.0, 20.0, 40.0, 200.0, 5.0], outcomes), official(tmp_path)]
    command = [sys.executable, str(ROOT / "benchmarks" / "speeds.py"), *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = {line.split()[1]: line for line in done.stdout.splitlines() if "5.00" in line}
    assert set(rows) == {"made-up", "theirs"}
    for row in rows.values():
        assert [cell.strip() for cell in row.split("│")[2:6]] == ["4", "3", "5.00 (3.75 to 7.50)", "23.3"]


def test_reports_of_one_agent_are_one_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    for number, (folder, seconds) in enumerate(((first, 10.0), (second, 40.0))):
        folder.mkdir()
        ours(folder, [seconds], ["completed"], first=number)
    main([str(first / "ours.json"), str(second / "ours.json"), str(first / "ours.json")])  # counted once
    (row,) = (line for line in capsys.readouterr().out.splitlines() if "made-up" in line)
    assert [cell.strip() for cell in row.split("│")[2:6]] == ["2", "2", "6.25 (4.38 to 8.12)", "25.0"]


def test_official_results_of_equal_names_are_not_taken_for_one_agent(tmp_path: Path) -> None:
    for agent in ("uniad", "vad"):
        (tmp_path / agent).mkdir()
    first, second = (official(tmp_path / agent) for agent in ("uniad", "vad"))
    main([str(first), str(first)])  # counted once
    with pytest.raises(SystemExit, match=r"holds 'theirs', as a file before it does"):
        main([str(first), str(second)])
    reported = ours(tmp_path, [10.0, 20.0], ["completed"] * 2)
    for files in (
        [reported, first.rename(first.with_name("made-up.json"))],
        [first.with_name("made-up.json"), reported],
    ):
        with pytest.raises(SystemExit, match=r"holds 'made-up', as a file before it does"):
            main([str(file) for file in files])


def test_a_folder_of_official_results_is_read_whole(tmp_path: Path) -> None:
    official(tmp_path)
    ((name, drives),) = drives_of(tmp_path)
    assert name == tmp_path.stem
    assert len(drives) == 4


def test_nothing_completed_is_an_error(tmp_path: Path) -> None:
    path = ours(tmp_path, [200.0, 10.0], ["failed", "completed"])
    with pytest.raises(SystemExit, match=r"made-up completed 1 of 2 routes\. Expected at least 2"):
        main([str(path)])


@pytest.mark.parametrize(("content", "said"), [("x", "cannot be read as JSON"), ("{}", "holds no official results")])
def test_what_is_neither_kind_is_refused(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(SystemExit, match=said):
        main([str(path)])
