"""An agent, its source, and a perturbation for tests that register them or install them with a distribution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.testing import ScriptedAgent

Install = Callable[..., None]
"""The fixture `install`, which puts a distribution with one entry point on the path."""

AGENT = """
class Agent:
    def sensors(self): return []
    def reset(self, route, seed): pass
    def act(self, observation): return None
"""


@dataclass
class NoisyWheel(Perturbation):
    gain: float = 0.5
    phrase = "noisy wheel {gain}"


def scripted() -> ScriptedAgent:
    return ScriptedAgent([Control()])
