"""The README's snippets run as written, from an empty folder, in a process of their own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_drive_robust.options.table import OPTIONS

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(mark: str) -> str:
    """The code block that follows `<!-- mark -->`."""
    match = re.search(rf"<!-- {re.escape(mark)} -->\n```\w*\n(.*?)```", README, re.DOTALL)
    assert match is not None, mark
    return match[1]


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environ = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "COV_"))}
    return subprocess.run(
        ["bash", "-c", command], cwd=folder, capture_output=True, text=True, check=False, env={**environ, "PATH": path}
    )


def test_it_shows_the_table_of_the_paper_as_it_was_driven() -> None:
    table = (ROOT / "benchmarks" / "paper" / "table.md").read_text(encoding="utf-8")
    rows = [line for line in table.partition("\n## RD")[2].partition("\n## ")[0].splitlines() if line.startswith("|")]
    assert len(rows) == 14
    assert "\n".join(rows) in README


def test_its_table_of_options_is_what_pytest_is_given() -> None:
    rows = re.findall(r"^\| `(--drive-[^`]+)` \|([^|]*)\|([^|]*)\|", README, re.MULTILINE)
    stated = {
        option.flag + (f"[={option.metavar}]" if option.bare else f" {option.metavar}".rstrip()): (
            "" if option.is_switch else f"`{option.name}`",
            f"`{option.default}`" if option.default else "off",
        )
        for option in OPTIONS.values()
    }
    assert {flag: (ini.strip(), default.strip()) for flag, ini, default in rows} == stated
    assert len(rows) == len(stated)


@pytest.mark.slow
def test_your_own_agent_runs_from_an_empty_folder(tmp_path: Path) -> None:
    for name in ("my_agent.py", "test_mine.py"):
        (tmp_path / name).write_text(block(name), encoding="utf-8")
    check, drive = block("my_agent commands").splitlines()
    checked = shell(check, tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    driven = shell(drive, tmp_path)
    assert driven.returncode == 0, driven.stdout + driven.stderr
    assert "my_agent:MyAgent" in driven.stdout
    assert "2 passed" in driven.stdout


@pytest.mark.slow
def test_your_own_perturbation_runs_from_an_empty_folder(tmp_path: Path) -> None:
    for name in ("conftest.py", "test_dimmed.py"):
        (tmp_path / name).write_text(block(name), encoding="utf-8")
    # an agent with a camera, or nothing would be dimmed
    options = "--drive-agent classical --drive-routes 801,2501 --drive-verdict point --drive-json run.json"
    driven = shell(f"pytest --drive-robust test_dimmed.py {options}", tmp_path)
    assert driven.returncode == 0, driven.stdout + driven.stderr
    episodes = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["episodes"]
    digests = {(episode["route_id"], episode["setting"]): episode["trace_digest"] for episode in episodes}
    for route in ("801", "2501"):
        assert digests[route, "dimmed camera 0.6"] != digests[route, "clean"]


def test_the_agent_is_twenty_lines_and_the_perturbation_ten() -> None:
    def lines(text: str) -> int:
        body = text.split("class ", 1)[1]
        return sum(bool(line.strip()) for line in body.splitlines())

    assert lines(block("my_agent.py")) <= 22
    assert lines(block("conftest.py").split("@pytest.hookimpl")[0]) <= 10


@pytest.mark.slow
def test_the_complete_table_is_one_more_command(tmp_path: Path) -> None:
    short = f"--drive-routes 801,2501 --drive-store={tmp_path / 'store'} --drive-report={tmp_path / 'look'}"
    driven = shell(f"{block('complete').strip()} {short}", ROOT)
    assert driven.returncode in (0, 1), driven.stdout + driven.stderr  # two routes need not meet the limits
    head, *rows = driven.stdout.partition("= drive-robust =")[2].partition("\n")[2].splitlines()
    assert head.split() == ["agent", "setting", "DS", "SR", "RD", "efficiency", "comfort", "routes", "verdict"]
    table = [row for row in rows if row.startswith(("classical ", "expert* "))]
    assert len(table) == 15
    assert all(row.split()[-2] == "2" for row in table)
    assert f"report: {tmp_path / 'look' / 'index.html'}" in rows
    assert (tmp_path / "look" / "data" / "run.js").is_file()
