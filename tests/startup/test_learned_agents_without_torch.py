"""The learned agents where torch is not installed, and what they import when."""

from __future__ import annotations

import subprocess
import sys

import pytest

LEARNED = ("simlingo", "tcp", "uniad", "vad")
ABSENT = """
import sys

for name in ("torch", "safetensors", "onnx"):
    sys.modules[name] = None  # as where it is not installed: importing it is an error, looking for it finds nothing
"""
CHECKED = """
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.cache_key.identity import agent_identity

registry = default_registry()
for name in {learned}:
    registry.entry("agents", name).load().check()
    agent_identity(name, registry)
heavy = {{"torch", "onnxruntime"}}
assert not heavy & {{name.partition(".")[0] for name in sys.modules if sys.modules[name] is not None}}
"""
DRIVEN = """
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

world, route = EmbeddedSimulator(SimulatorOptions(tick_cap=25)), named_routes("dev10")[0]
made = {{name: registry.agent(name) for name in {learned}}}
made["simlingo that speaks"] = registry.entry("agents", "simlingo").load()(commentary=True)
for name, agent in made.items():
    result = drive_episode(world, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name=name)
    assert (result.ticks, result.outcome) == (25, Outcome.FAILED), (name, result.end_detail)
assert made["simlingo that speaks"].said
assert "onnxruntime" in sys.modules
try:
    registry.entry("agents", "tcp").load()(engine="torch")
except Exception as error:
    print(error)
"""


def run(program: str) -> str:
    done = subprocess.run([sys.executable, "-c", program.format(learned=LEARNED)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_they_are_listed_and_checked_before_any_runtime_is_imported() -> None:
    run("import sys\n" + CHECKED)


@pytest.mark.slow
def test_without_torch_they_are_checked_and_drive_and_its_engine_says_what_it_needs() -> None:
    told = run(ABSENT + CHECKED + DRIVEN)
    assert "need torch for this, which is not installed: pip install 'drive-robust-agents[torch]'" in told
