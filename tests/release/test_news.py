"""News are files in `changelog.d/` until a release puts them into `CHANGELOG.md`; a tag without them is refused."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install -e '.[dev]'")

ROOT = Path(__file__).parents[2]
KINDS = ("added", "changed", "fixed", "removed")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for name in ("pyproject.toml", "CHANGELOG.md"):
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / "changelog.d").mkdir()
    (tmp_path / "changelog.d" / "README.md").write_text("how to write them")
    return tmp_path


def build(copy: Path, version: str) -> None:
    command = [sys.executable, "-m", "towncrier", "build", "--yes", "--version", version, "--date", "2030-01-02"]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def refusal(copy: Path, tag: str) -> str:
    """What the first job of the release says about a tag; empty when it lets it pass."""
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text())["jobs"]
    (script,) = (step["run"] for step in jobs["news"]["steps"] if "run" in step)
    environ = {**os.environ, "GITHUB_REF_NAME": tag}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script], cwd=copy, env=environ, capture_output=True, text=True, check=False
    )
    assert (done.returncode != 0) == bool(done.stderr)
    return done.stderr


def test_a_release_puts_the_news_above_what_is_there_and_removes_their_files(copy: Path) -> None:
    before = (copy / "CHANGELOG.md").read_text()
    for kind in KINDS:
        (copy / "changelog.d" / f"+{kind}.{kind}.md").write_text(f"Something is {kind}.\n")
    build(copy, "1.2.3")
    after = (copy / "CHANGELOG.md").read_text()
    new = after[: after.index("## 0.1.0")].partition("<!-- news -->")[2]
    assert new.strip().startswith("## 1.2.3 (2030-01-02)")
    for kind in KINDS:
        assert f"### {kind.capitalize()}\n\n- Something is {kind}." in new
    assert after.endswith(before.partition("<!-- news -->")[2].lstrip())
    assert [path.name for path in (copy / "changelog.d").iterdir()] == ["README.md"]


def test_a_tag_needs_its_section_with_a_day_and_no_news_left_over(copy: Path) -> None:
    assert "towncrier build --version 1.2.3" in refusal(copy, "v1.2.3")
    assert refusal(copy, "v0.1.0")  # its section says (unreleased)
    (copy / "changelog.d" / "+one.added.md").write_text("Something.\n")
    build(copy, "1.2.3")
    assert refusal(copy, "v1.2.3") == ""
    assert refusal(copy, "v1.2.30")
    assert refusal(copy, "v1x2.3")
    (copy / "changelog.d" / "+two.added.md").write_text("Something else.\n")
    assert "+two.added.md" in refusal(copy, "v1.2.3")


def test_the_news_here_are_of_known_kinds() -> None:
    names = {path.name for path in (ROOT / "changelog.d").iterdir()} - {"README.md"}
    assert [name for name in names if not re.fullmatch(rf"[+\w-]+\.({'|'.join(KINDS)})\.md", name)] == []
