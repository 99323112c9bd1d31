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
