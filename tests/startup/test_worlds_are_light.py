"""A process that drives loads the road model of highway-env and none of its environments, and leaves it whole."""

from __future__ import annotations

import subprocess
import sys

DRIVE = """
import sys
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes

world = EmbeddedSimulator()
world.reset(named_routes("dev10")[0], seed=0, cameras=())
"""
LOADED = """
print(*sorted(name for name in ("gymnasium", "highway_env", "matplotlib", "pandas", "pygame") if name in sys.modules))
"""
ENVIRONMENTS = """
import gymnasium
import highway_env
import highway_env.road.lane

env = gymnasium.make("roundabout-v0").unwrapped
env.reset(seed=0)
lane = env.vehicle.lane
print(isinstance(lane, highway_env.road.lane.AbstractLane), len(highway_env.__file__) > 0)
"""


def printed(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_world_loads_no_environments():
    assert printed(DRIVE + LOADED) == ""


def test_highway_env_is_whole_after_a_world():
    assert printed(DRIVE + ENVIRONMENTS) == "True True"


def test_a_world_takes_the_road_model_that_is_there():
    code = "import highway_env.road.lane as lanes\n" + DRIVE
    code += "from pytest_drive_robust.simulators.embedded.towns.road_library import StraightLane\n"
    assert printed(code + "print(StraightLane is lanes.StraightLane)") == "True"
