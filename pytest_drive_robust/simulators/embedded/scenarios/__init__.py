"""The scripted situations, grouped by what the ego has to do.

Constants are Bench2Drive's (`scenario_runner/srunner/scenarios`).
"""

from pytest_drive_robust.simulators.embedded.scenarios import (
    bicycles,
    crossings,
    cut_ins,
    flows,
    hazards,
    highway,
    interurban,
    junctions,
    obstacles,
    parking_exit,
    priority,
    standstills,
    traffic,
)
from pytest_drive_robust.simulators.embedded.scenarios.base import SCENARIOS, ScenarioType, Site

__all__ = [
    "SCENARIOS",
    "ScenarioType",
    "Site",
    "bicycles",
    "crossings",
    "cut_ins",
    "flows",
    "hazards",
    "highway",
    "interurban",
    "junctions",
    "obstacles",
    "parking_exit",
    "priority",
    "standstills",
    "traffic",
]
