"""The scripted situations, grouped by what the ego has to do.

Constants are Bench2Drive's (`scenario_runner/srunner/scenarios`). Importing this package fills `SCENARIOS`.
Where routes for them are drawn stands in `route_files/sites.csv`.
"""

from pytest_drive_robust.simulators.embedded.scenarios import (  # noqa: F401 -- each module registers its types
    cut_ins,
    hazards,
    highway,
    junction_flows,
    obstacles,
    plain_junctions,
    priority,
    traffic,
    walkers,
)
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import SCENARIOS, ScenarioType

__all__ = ["SCENARIOS", "ScenarioType"]
