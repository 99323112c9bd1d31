"""The rigs of the data are those that the agents ask for."""

from __future__ import annotations

import pytest

from drive_robust_agents.training.data.rigs import agent_rig
from pytest_drive_robust.errors import UnknownNameError


def test_rigs_are_the_cameras_that_the_agents_ask_for() -> None:
    pytest.importorskip("torch")
    from drive_robust_agents import simlingo, tcp
    from drive_robust_agents._wrappers import bev_agent

    assert agent_rig("tcp").cameras == tcp.CAMERAS
    assert agent_rig("simlingo").cameras == tuple(simlingo.CAMERAS)
    assert agent_rig("uniad").cameras == agent_rig("vad").cameras == tuple(bev_agent.CAMERAS)


def test_an_unknown_agent_has_no_rig() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'simlingo'"):
        agent_rig("simlingos")
