"""The rigs of the data are those of the agents, and to know them needs no network."""

from __future__ import annotations

import subprocess
import sys

import pytest

from drive_robust_agents.training.data.rigs import agent_rig
from pytest_drive_robust.errors import UnknownNameError


def test_processes_that_collect_data_do_not_import_torch() -> None:
    code = "import sys; import drive_robust_agents.training.data.rigs; print('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "False\n"


def test_an_unknown_agent_has_no_rig() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'simlingo'"):
        agent_rig("simlingos")
