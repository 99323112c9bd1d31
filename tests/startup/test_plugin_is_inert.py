"""Everybody who has us installed pays for our imports in every pytest run: there must be none to speak of."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
HEAVY = ("cv2", "gymnasium", "highway_env", "jinja2", "numba", "numpy", "rich", "scipy", "torch", "filelock")

OURS = [
    "pytest_drive_robust",
    "pytest_drive_robust.hookspecs",
    "pytest_drive_robust.options",
    "pytest_drive_robust.options.table",
    "pytest_drive_robust.plugin",
    "pytest_drive_robust.plugin.fixtures",
    "pytest_drive_robust.plugin.hooks",
]
"""What a session loads that has us installed and uses nothing of us."""

CONFTEST = """
import sys

def pytest_unconfigure():
    print("LOADED", *sorted(sys.modules))
"""

SUITE = """
import pytest
from pytest_drive_robust import (
    BurstFrameDrop, FrameBlend, GpsNoise, InferenceLatency, PartialObservation, SensorDelay, SpeedNoise,
    requirement, requirements,
)

@pytest.mark.drive_robust(seeds=[0, 1])
@pytest.mark.parametrize("requirement", [
    *requirements("RD under 200 ms latency <= 0.30"),
    requirement("RD", BurstFrameDrop(length_s=3) + InferenceLatency(ms=100)) <= 0.10,
])
def test_it(drive, drive_agent, requirement):
    drive.check(requirement)

def test_plain():
    pass
"""


PLAIN = """
def test_plain():
    pass
"""


def loaded_by_a_session(folder: Path, plugin_args: tuple[str, ...], suite: str, *, summary: str) -> list[str]:
    """Return the modules that a pytest session over `suite` without `--drive-robust` ends with, sorted."""
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "test_suite.py").write_text(suite)
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    plugin = plugin_args or ("-p", "pytest_drive_robust.plugin")
    command = [sys.executable, "-m", "pytest", "-s", "-p", "no:cacheprovider", *plugin]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert summary in done.stdout
    return next(line for line in done.stdout.splitlines() if "LOADED" in line).split()


def test_a_session_without_the_switch_imports_nothing_heavy(tmp_path, plugin_args):
    loaded = loaded_by_a_session(tmp_path, plugin_args, SUITE, summary="1 passed, 2 skipped")
    assert "pytest_drive_robust" in loaded
    assert [name for name in HEAVY if name in loaded] == []


def test_a_session_that_uses_nothing_of_us_imports_the_hooks_and_the_table_of_options(tmp_path, plugin_args):
    loaded = loaded_by_a_session(tmp_path, plugin_args, PLAIN, summary="1 passed")
    assert [name for name in loaded if name.startswith("pytest_drive_robust")] == OURS
