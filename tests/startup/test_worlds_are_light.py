"""A process that drives loads no environments and none of their libraries."""

from __future__ import annotations

import subprocess
import sys

DRIVE = """
import sys
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

world = EmbeddedSimulator()
world.reset(named_routes("dev10")[0], seed=0, cameras=())
print(*sorted(name for name in ("gymnasium", "highway_env", "matplotlib", "pandas", "pygame") if name in sys.modules))
"""


def test_a_world_loads_no_environments():
    done = subprocess.run([sys.executable, "-c", DRIVE], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == ""
