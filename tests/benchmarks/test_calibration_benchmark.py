"""`benchmarks/calibration.py` and `controllers.py`: what they refuse, and the page that is kept up."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import calibration
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("script", ["calibration", "controllers"])
def test_a_mistyped_agent_is_said_in_a_sentence(script: str, tmp_path: Path) -> None:
    command = [sys.executable, str(BENCHMARKS / f"{script}.py"), "--agents", "simlingoo", "--routes", "601"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 1
    assert "error: " in done.stderr
    assert "Did you mean 'simlingo'?" in done.stderr
    assert "Traceback" not in done.stderr


def report(score: str) -> calibration.Report:
    return calibration.Report("Calibration", "Noted.", ("scenario", "DS"), (("Accident", score),), ())


def test_a_section_is_replaced_and_the_others_stay(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Page\n\nBy hand.\n\n## Calibration\n\nold\n\n## Sensitivity of tcp\n\nkept\n", encoding="utf-8")
    calibration.write(report("1.0"), page)
    said = page.read_text(encoding="utf-8")
    assert said.startswith("# Page\n\nBy hand.\n\n## Sensitivity of tcp\n\nkept\n\n## Calibration\n")
    assert said.endswith("| Accident | 1.0 |\n")
    assert "old" not in said


def test_a_page_stays_whole_where_writing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    calibration.write(report("1.0"), page)
    before = page.read_text(encoding="utf-8")

    def full(*_: object) -> int:
        raise OSError("no space left")

    monkeypatch.setattr("os.write", full)
    with pytest.raises(OSError, match="no space left"):
        calibration.write(report("2.0"), page)
    assert page.read_text(encoding="utf-8") == before


def score(agent: str, scenario: str, route: str, success: bool, points: float) -> calibration.Score:
    return calibration.Score(agent, scenario, route, "clean", 0, success, points)


def test_successes_and_scores_are_two_tables_and_a_picture() -> None:
    scores = [
        score("expert", "Accident", "1", True, 100.0),
        score("expert", "Accident", "2", False, 60.0),
        score("blind:speed=4", "Accident", "1", False, 20.0),
        score("blind:speed=4", "Accident", "2", False, 30.0),
    ]
    passed, driven = calibration.calibration(scores, ["expert", "blind:speed=4"], "Two routes.")
    assert passed.columns == driven.columns == ("scenario", "expert", "blind 4")
    assert passed.rows == (("Accident", "1/2", "0/2"),)
    assert driven.rows == (("Accident", "80.0", "25.0"),)
    assert passed.totals[0] == ("all [%]", "50.0", "0.0")
    assert driven.totals[0] == ("all", "80.0", "25.0")
    assert calibration.drawn(passed) == calibration.drawn(passed)
    assert calibration.drawn(passed).startswith("<?xml")
