"""A stored run of real episodes: a turn, clean and under a failure."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

SUITE = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements("DS under clean >= 1\\nDS under GPS noise 15 m >= 99"))
def test_it(drive, requirement):
    drive.check(requirement)
"""


@pytest.fixture(scope="session")
def driven(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Return a folder with a stored run, `one`, and its episodes. The workers of pytest-xdist share it."""
    base = tmp_path_factory.getbasetemp()
    folder = (base if worker_id == "master" else base.parent) / "stored"
    with FileLock(folder.with_suffix(".lock")):
        if not folder.joinpath(".drive-robust", "runs", "one.json").is_file():
            folder.mkdir(exist_ok=True)
            folder.joinpath("test_suite.py").write_text(SUITE)
            command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--drive-robust"]
            command += ["--drive-agent", "blind", "--drive-routes", "3901", "--drive-verdict", "point"]
            command += ["--drive-workers", "1", "--drive-stuck-stop", "10", "--drive-save=one", "test_suite.py"]
            kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "COV_"))}
            told = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=kept)
            assert told.returncode == 1, told.stdout + told.stderr
    return folder


@pytest.fixture
def project(driven: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Enter that folder."""
    monkeypatch.chdir(driven)
    return driven
