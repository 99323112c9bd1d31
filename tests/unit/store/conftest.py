from __future__ import annotations

import pytest
from result_factory import make_result

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.store.folder import FolderStore

TIMED_OUT = make_result("3", end=End.BLOCKED, outcome=Outcome.AGENT_ERROR)


@pytest.fixture
def store(tmp_path):
    """Three good records of two agents and one that no other run takes over."""
    kept = FolderStore(tmp_path / ".drive-robust", run="one")
    kept.put("aa01", make_result("1"))
    kept.put("aa02", make_result("2", end=End.TICK_CAP))
    kept.put("bb01", make_result("1", agent="other"))
    kept.put("bb02", TIMED_OUT)
    return kept
