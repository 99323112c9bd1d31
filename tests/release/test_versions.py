"""Both distributions have the version of the last tag, and some version wherever git tells nothing."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = (
    *("pyproject.toml", "README.md", "LICENSE", ".gitattributes", ".git_archival.txt"),
    *("agents/pyproject.toml", "agents/README.md", "agents/LICENSE", "agents/.git_archival.txt"),
)


def shell(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def git(folder: Path, *words: str) -> str:
    return shell(folder, "git", "-c", "user.name=t", "-c", "user.email=t@example.org", *words)


def versions(folder: Path) -> list[str]:
    """What the two projects in `folder` are built as."""
    return [shell(folder / place, sys.executable, "-m", "hatchling", "version") for place in (".", "agents")]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    folder = tmp_path / "repository"
    for name in FILES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    git(folder, "init", "-q", "-b", "main")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "first")
    return folder


def test_a_tag_is_the_version_and_a_commit_after_it_comes_before_the_next(repository: Path) -> None:
    git(repository, "tag", "v1.2.3")
    assert versions(repository) == ["1.2.3", "1.2.3"]
    git(repository, "commit", "-q", "--allow-empty", "-m", "second")
    for version in versions(repository):
        assert re.fullmatch(r"1\.2\.4\.dev1\+g[0-9a-f]+", version)


def test_without_a_tag_commits_are_counted(repository: Path) -> None:
    for version in versions(repository):
        assert re.fullmatch(r"0\.1\.0\.dev1\+g[0-9a-f]+", version)


def shallow(repository: Path, place: Path) -> None:
    git(repository, "commit", "-q", "--allow-empty", "-m", "second")
    git(place.parent, "clone", "-q", "--depth=1", repository.as_uri(), place.name)


def copied_without_history(repository: Path, place: Path) -> None:
    shutil.copytree(repository, place, ignore=shutil.ignore_patterns(".git"))


def archived_without_a_tag(repository: Path, place: Path) -> None:
    git(repository, "archive", "-o", str(place.with_suffix(".tar")), "HEAD")
    with tarfile.open(place.with_suffix(".tar")) as archive:
        archive.extractall(place)


@pytest.mark.parametrize("made", [shallow, copied_without_history, archived_without_a_tag])
def test_there_is_a_version_where_git_tells_nothing(
    made: Callable[[Path, Path], None], repository: Path, tmp_path: Path
) -> None:
    made(repository, tmp_path / "copy")
    for version in versions(tmp_path / "copy"):
        assert version[0] == "0"


def test_an_archive_of_a_tag_has_its_version(repository: Path, tmp_path: Path) -> None:
    git(repository, "tag", "v1.2.3")
    archived_without_a_tag(repository, tmp_path / "copy")
    assert versions(tmp_path / "copy") == ["1.2.3", "1.2.3"]
