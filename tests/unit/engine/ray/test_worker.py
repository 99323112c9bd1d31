from __future__ import annotations

import sys
from pathlib import Path

import pytest

from pytest_drive_robust.engine.ray.worker import setup_on_node
from pytest_drive_robust.engine.worker_setup import WorkerSetup


def test_paths_are_found_where_the_folder_was_copied_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home, node = tmp_path / "run", tmp_path / "node"
    node.mkdir()
    plugins = (("agents", str(home / "agents.py")), ("installed", "/somewhere/else.py"))
    setup = WorkerSetup((str(home / "src"), str(home), *sys.path), str(home), plugins, "embedded")
    monkeypatch.chdir(node)
    there = setup_on_node(setup)
    assert there.folder == str(node)
    assert there.python_path == (str(node / "src"), str(node), *sys.path)
    assert there.plugins == (("agents", str(node / "agents.py")), ("installed", "/somewhere/else.py"))
