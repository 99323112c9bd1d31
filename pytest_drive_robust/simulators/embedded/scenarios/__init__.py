"""The scripted situations, grouped by what the ego has to do.

Constants are Bench2Drive's (`scenario_runner/srunner/scenarios`). Importing this package fills `SCENARIOS`.
"""

from pytest_drive_robust.simulators.embedded.scenarios import (  # noqa: F401 -- each module registers its types
    bicycles,
    cut_ins,
    hazards,
    highway,
    interurban,
    junction_flows,
    obstacles,
    parking_exit,
    plain_junctions,
    priority,
    standstills,
    traffic,
    walkers,
)
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import SCENARIOS, ScenarioType, Site

__all__ = ["SCENARIOS", "ScenarioType", "Site"]
