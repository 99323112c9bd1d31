"""What the README says. Its blocks run with those of the other pages: `tests/docs/test_pages_run.py`."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documented_pages import blocks_of
from PIL import Image

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


def test_it_is_short() -> None:
    assert len(README.splitlines()) <= 150


def test_its_film_is_small_and_moves() -> None:
    name = re.search(r"!\[[^]]+\]\((\S+)\)", README.partition("\n## ")[0])
    assert name is not None
    film = ROOT / name[1]
    assert film.stat().st_size < 2_000_000
    with Image.open(film) as moving:
        assert moving.n_frames > 10


def test_its_links_lead_somewhere() -> None:
    inside = [link for link in re.findall(r"\]\(([^)#]+)\)", README) if "://" not in link]
    assert len(inside) > 10
    assert [link for link in inside if not (ROOT / link).exists()] == []


def test_the_agent_is_twenty_lines() -> None:
    (agent,) = (block for block in blocks_of(README) if block.comment == "file: my_agent.py")
    assert sum(bool(line.strip()) for line in agent.text.split("class ", 1)[1].splitlines()) <= 22


@pytest.mark.slow
def test_the_complete_table_is_one_more_command_that_ends_with_the_path_of_its_report(tmp_path: Path) -> None:
    for name in ("conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / "suites", tmp_path / "suites", ignore=shutil.ignore_patterns("__pycache__"))
    driven = shell(f"{block('complete').strip()} --drive-routes 4301", tmp_path)
    assert driven.returncode in (0, 1), driven.stdout + driven.stderr  # one route need not meet the limits
    head, *rows = driven.stdout.partition("= drive-robust =")[2].partition("\n")[2].strip().splitlines()
    assert head.split() == ["agent", "setting", "DS", "SR", "RD", "efficiency", "comfort", "routes", "verdict"]
    table = [row for row in rows if row.startswith(("tcp ", "expert* "))]
    assert len(table) == 15
    assert all(row.split()[-2] == "1" for row in table)
    report = next(row.removeprefix("report: ") for row in reversed(rows) if row.startswith("report: "))
    assert report in README
    assert (tmp_path / report).is_file()
    assert (tmp_path / report).with_name("data").joinpath("run.js").is_file()
