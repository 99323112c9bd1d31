"""Everybody who has us installed pays for our imports in every pytest run: there must be none to speak of."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
HEAVY = ("cv2", "gymnasium", "highway_env", "jinja2", "numba", "numpy", "rich", "scipy", "torch", "filelock")

CONFTEST = """
import sys

def pytest_unconfigure():
    print("LOADED", *sorted(name for name in sys.modules if "." not in name))
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


def test_a_session_without_the_switch_imports_nothing_heavy(tmp_path, plugin_args):
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_suite.py").write_text(SUITE)
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    plugin = plugin_args or ("-p", "pytest_drive_robust.plugin")
    command = [sys.executable, "-m", "pytest", "-s", "-p", "no:cacheprovider", *plugin]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed, 2 skipped" in done.stdout
    loaded = next(line for line in done.stdout.splitlines() if "LOADED" in line).split()
    assert "pytest_drive_robust" in loaded
    assert [name for name in HEAVY if name in loaded] == []
