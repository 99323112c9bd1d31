"""The scripted situations, grouped by what the ego has to do.

Constants are Bench2Drive's (`scenario_runner/srunner/scenarios`).
"""

from pytest_drive_robust.simulators.embedded.scenarios import crossings, cut_ins, junctions, obstacles, traffic
from pytest_drive_robust.simulators.embedded.scenarios.base import SCENARIOS, ScenarioType, Site

__all__ = ["SCENARIOS", "ScenarioType", "Site", "crossings", "cut_ins", "junctions", "obstacles", "traffic"]
