"""The suites that ship, as a user's pytest finds them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_drive_robust import Setting, requirements
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


@pytest.mark.parametrize(
    ("args", "files"),
    [
        ((), "limits/tcp.txt"),
        (("--drive-agent", "tcp:mode=ctrl", "--drive-reading", "released"), "limits/tcp_released.txt"),
        (("--drive-agent", "classical", "-k", "reading"), "limits/classical.txt and limits/classical_released.txt"),
        (("-o", "drive_agent=classical"), "limits/classical.txt"),
        (("--drive-agent", "my_agent:MyAgent"), "limits/others.txt"),
        (("--drive-results", "clean=official"), "limits/others.txt"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_an_agent_is_asked_for_the_limits_of_its_name(args: tuple[str, ...], files: str) -> None:
    assert f"suites/paper: the limits are those of {files}\n" in output_of("suites/", "--collect-only", "-q", *args)


def test_an_agent_is_asked_for_a_file_that_somebody_adds_and_a_problem_in_it_names_it(tmp_path: Path) -> None:
    suite = shutil.copytree(ROOT / "suites" / "paper", tmp_path / "paper")
    asked = ("-c", "/dev/null", "--collect-only", "-q", "--drive-agent", "my_agent:MyAgent", str(suite))
    (suite / "limits" / "my_agent.txt").write_text("DS under clean >= 12\n")
    assert "test_paper_reading[ds-clean-ge-12]" in output_of(*asked)
    (suite / "limits" / "my_agent.txt").write_text("DS under klean >= 12\n")
    with pytest.raises(subprocess.CalledProcessError) as refused:
        output_of(*asked)
    assert refused.value.returncode == 4
    assert "1 problem in my_agent.txt:\n  line 1: DS under klean >= 12" in refused.value.stderr


def test_every_file_of_limits_asks_for_the_same_settings() -> None:
    files = sorted((ROOT / "suites" / "paper" / "limits").glob("*.txt"))
    asked = {file.name: [(item.metric.name, str(item.setting)) for item in requirements(file)] for file in files}
    assert {"tcp.txt", "tcp_released.txt", "classical.txt", "classical_released.txt"} < set(asked)
    assert {f"{name.removesuffix('.txt')}_released.txt" for name in asked if "_released" not in name} < set(asked)
    assert [name for name in asked if asked[name] != asked["others.txt"]] == []


def test_what_is_the_same_in_both_readings_has_the_same_limit() -> None:
    for file in sorted((ROOT / "suites" / "paper" / "limits").glob("*_released.txt")):
        paper = list(map(str, requirements(file.with_name(file.name.replace("_released", "")))))
        released = [(str(item.setting), str(item)) for item in requirements(file)]
        same = [
            item
            for said, item in released
            if said == "clean" or str(Setting.parse(f"{said} (reading=released)")) == said
        ]
        assert len(same) == 7, file.name
        assert set(same) < set(paper), file.name


def test_the_agent_that_is_driven_by_default_is_known_to_the_suite() -> None:
    assert (ROOT / "suites" / "paper" / "limits" / f"{RunOptions().agent}.txt").is_file()


def test_our_own_ini_judges_as_everybody_s_does() -> None:
    ini = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert not any(name in ini for name in ("drive_verdict", "drive_margin", "drive_alpha", "drive_routes"))
    assert RunOptions().verdict_rule.for_routes(44).kind == "evidence"
