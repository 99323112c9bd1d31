"""What the files of the forge say: actions that cannot change under us, rights asked for, commands that exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install -e '.[dev]'")

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
ACTIONS = [ROOT / "action.yml", *WORKFLOWS]


def sessions() -> set[str]:
    command = [sys.executable, "-m", "nox", "-f", str(ROOT / "noxfile.py"), "--list"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"^[*-] (.+?) -> ", listed, re.MULTILINE))


@pytest.mark.parametrize("file", ACTIONS, ids=lambda file: str(file.name))
def test_every_action_is_pinned_to_a_commit_with_its_version_beside_it(file: Path) -> None:
    used = re.findall(r"^\s*(?:- )?uses: (.+)$", file.read_text(), re.MULTILINE)
    pinned = re.compile(r"[\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+(\.\d+)+|\./\.github/workflows/\w+\.yml( #.*)?")
    assert [action for action in used if not pinned.fullmatch(action)] == []


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: str(file.name))
def test_a_workflow_reads_unless_a_job_asks_for_more_and_no_job_runs_for_ever(file: Path) -> None:
    document: dict[str, Any] = yaml.safe_load(file.read_text())
    assert document["permissions"] == {"contents": "read"}
    assert "concurrency" in document
    for name, job in document["jobs"].items():
        assert "timeout-minutes" in job or "uses" in job or name == "deploy", name


def test_the_sessions_of_nox_that_are_named_exist() -> None:
    known = sessions()
    text = (ROOT / ".github" / "workflows" / "wheels.yml").read_text()
    jobs = yaml.safe_load(text)["jobs"]
    asked = set()
    for job in jobs.values():
        matrix = job.get("strategy", {}).get("matrix", {})
        rows = [
            {"python": python, "pytest": version, "xdist": xdist}
            for python in matrix.get("python", [""])
            for version in matrix.get("pytest", [""])
            for xdist in matrix.get("xdist", [""])
        ]
        for template in (step["env"]["SESSION"] for step in job["steps"] if "SESSION" in step.get("env", {})):
            for row in [*rows, *matrix.get("include", [])]:
                asked.add(re.sub(r"\$\{\{ matrix\.(\w+) \}\}", lambda found, row=row: row[found[1]], template))
    assert len(asked) > 10
    assert asked <= known
    asked = set(re.findall(r'`nox -s "([^"]+)"', (ROOT / "CONTRIBUTING.md").read_text()))
    assert asked
    assert asked <= known


def test_the_image_is_made_of_what_the_wheels_need() -> None:
    taken = re.findall(r"^!(.+)$", (ROOT / ".dockerignore").read_text(), re.MULTILINE)
    assert [name for name in taken if not (ROOT / name).exists()] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["sdist"]
    assert {name.lstrip("/") for name in project["include"]} | {"agents", "pyproject.toml"} == set(taken)
