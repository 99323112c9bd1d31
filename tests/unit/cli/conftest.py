"""A folder that the commands are run in: one with agents in a module, or one whose parents hold no repository."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest
import replayed_agents

AGENTS = """
from pytest_drive_robust import Control

class Good:
    def sensors(self): return []
    def reset(self, route, seed): pass
    def act(self, observation): return Control(throttle=1.0, steer=max(-1.0, min(1.0, -0.1 * observation.gps.y_m)))

class Bad(Good):
    def act(self, observation): return None

class OneThreaded(Good):
    def act(self, observation):
        import cv2
        assert cv2.getNumThreads() == 1, "as in a worker process"
        return super().act(observation)
"""


@pytest.fixture
def agents_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the agents `cli_agents:Good` and `cli_agents:Bad`."""
    (tmp_path / "cli_agents.py").write_text(AGENTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


@pytest.fixture
def two_threads() -> Iterator[None]:
    """OpenCV computes on two threads, whatever the machine has."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    yield
    cv2.setNumThreads(before)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, in no git repository, of nobody that git knows, outside CI."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(tmp_path / "gitconfig"))
    return tmp_path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the agents of `replayed_agents` in the module `film_agents`."""
    (tmp_path / "film_agents.py").write_text(replayed_agents.AGENTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "film_agents", raising=False)
    return tmp_path
