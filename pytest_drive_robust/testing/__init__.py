"""Tools for authors of agents, perturbations or simulators: a tiny world, scripted agents, and contract checks.

::

    from pytest_drive_robust.testing import check_agent

    def test_my_agent_keeps_the_contract():
        report = check_agent(MyAgent)
        assert report.ok, str(report)
"""

from __future__ import annotations

from pytest_drive_robust.testing.agent_contract import check_agent
from pytest_drive_robust.testing.agents import RecordingAgent, ScriptedAgent
from pytest_drive_robust.testing.fake_simulator import FakeSimulator, fake_route
from pytest_drive_robust.testing.perturbation_contract import check_perturbation
from pytest_drive_robust.testing.report import Check, ContractReport
from pytest_drive_robust.testing.simulator_contract import check_simulator

__all__ = [
    "Check",
    "ContractReport",
    "FakeSimulator",
    "RecordingAgent",
    "ScriptedAgent",
    "check_agent",
    "check_perturbation",
    "check_simulator",
    "fake_route",
]
