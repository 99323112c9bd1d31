"""The suites that ship, as a user's pytest finds them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pytest_drive_robust.options.run import RunOptions

ROOT = Path(__file__).parents[2]


def output_of(*args: str) -> str:
    command = [sys.executable, "-m", "pytest", *args]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def named(*args: str) -> list[str]:
    return [line for line in output_of("--collect-only", "-q", *args).splitlines() if "::" in line]


def collected(*args: str) -> list[str]:
    return [name.partition("::")[0] for name in named(*args)]


def test_smoke_comes_before_paper() -> None:
    modules = list(dict.fromkeys(collected("suites/")))
    assert modules == ["suites/smoke/test_smoke.py", "suites/paper/test_paper.py"]


def test_one_suite_alone_is_collected_alone() -> None:
    assert set(collected("suites/paper")) == {"suites/paper/test_paper.py"}


def test_the_default_command_leaves_the_other_reading_out_and_says_how_to_choose_it() -> None:
    names = named("suites/paper")
    assert len(names) == 12
    assert all("::test_paper_reading[" in name for name in names)
    shown = output_of("suites/paper", "--collect-only")
    assert (
        "suites/paper: 12 requirements in the reading released are left out; --drive-reading released runs them"
        in shown
    )
    assert "12/24 tests collected (12 deselected)" in shown


@pytest.mark.parametrize(
    ("args", "readings"),
    [
        (("-k", "released"), ("released",)),
        (("-k", "paper_reading"), ("paper",)),
        (("-k", "reading"), ("paper", "released")),
        (("-k", "latency"), ("paper",)),
        (("-k", "latency and released"), ("released",)),
        (("--drive-reading", "released"), ("released",)),
        (("--drive-reading", "released", "-k", "latency"), ("released",)),
        (("--drive-reading", "paper"), ("paper",)),
    ],
    ids=" ".join,
)
def test_a_reading_is_chosen_by_k_or_by_its_option(args: tuple[str, ...], readings: tuple[str, ...]) -> None:
    assert {name.partition("::test_")[2].partition("_reading")[0] for name in named("suites/paper", *args)} == set(
        readings
    )


def test_a_test_that_is_named_runs_whatever_its_reading() -> None:
    assert len(named("suites/paper/test_paper.py::test_released_reading")) == 12


def test_both_readings_ask_for_the_same_settings() -> None:
    names = named("suites/paper", "-k", "reading")
    settings = [
        {name.partition("[")[2].rpartition("-")[0] for name in names if f"test_{reading}_" in name}
        for reading in ("paper", "released")
    ]
    assert settings[0] == settings[1]


def test_our_own_ini_judges_as_everybody_s_does() -> None:
    ini = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert not any(name in ini for name in ("drive_verdict", "drive_margin", "drive_alpha", "drive_routes"))
    assert RunOptions().verdict_rule.for_routes(44).kind == "evidence"
