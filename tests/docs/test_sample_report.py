"""The committed sample of a report is what the pages are today, and small."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from report_pages import data_of

from pytest_drive_robust.report.pages.episodes import EpisodeTable

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "docs" / "extra" / "sample-report"
STATIC = ROOT / "pytest_drive_robust" / "report" / "pages" / "static"


def test_its_scripts_and_styles_are_those_of_the_package():
    told = f"cp {STATIC.relative_to(ROOT)}/* {SAMPLE.relative_to(ROOT)}/static/"
    for folder, other in ((STATIC, SAMPLE / "static"), (SAMPLE / "static", STATIC)):
        for file in folder.iterdir():
            assert (other / file.name).read_bytes() == file.read_bytes(), told


def test_its_data_is_of_the_paper_suite_and_complete():
    run = data_of(SAMPLE)
    assert set(EpisodeTable.COLUMNS) < set(run["episodes"]), "docs/gallery/report.md says how to make it again"
    assert len(run["requirements"]) == 12
    assert all((SAMPLE / "data" / f"route-{place}.js").is_file() for place in range(len(run["routes"])))
    assert all(run["episodes"]["trace"])


def test_it_is_small():
    assert sum(file.stat().st_size for file in SAMPLE.rglob("*") if file.is_file()) < 2e6


@pytest.mark.slow
def test_the_command_of_the_readme_ends_with_the_path_of_a_report(tmp_path):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"<!-- complete -->\n```sh\n(.*)\n```", readme)
    shutil.copytree(ROOT / "suites", tmp_path / "suites", ignore=shutil.ignore_patterns("__pycache__"))
    words = [sys.executable, "-m", *shlex.split(command), "-p", "no:cacheprovider", "-n", "0"]
    words += ["--drive-routes", "601", "--drive-workers", "1", "-k", "clean or 100ms"]
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "COV_"))}
    told = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, env=kept)
    assert told.returncode in (0, 1), told.stdout + told.stderr
    after_table = told.stdout.partition("= drive-robust =")[2].splitlines()
    path = next(line.removeprefix("report: ") for line in reversed(after_table) if line.startswith("report: "))
    assert path in readme
    assert (tmp_path / path).is_file()
