"""The words that messages share."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust.errors import from_here


def test_a_path_is_shown_from_the_current_folder_and_whole_outside_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert from_here(tmp_path / "suites" / "test_it.py") == Path("suites", "test_it.py")
    assert from_here(tmp_path.parent / "elsewhere.py") == tmp_path.parent / "elsewhere.py"


def test_a_path_is_shown_whole_when_the_current_folder_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    try:
        gone.rmdir()
    except OSError:
        pytest.skip("this system keeps the current folder")
    assert from_here(tmp_path / "agent.py") == tmp_path / "agent.py"
