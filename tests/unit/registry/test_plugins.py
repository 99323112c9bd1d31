from __future__ import annotations

import sys
from types import ModuleType

from pytest_drive_robust.registry.plugins import imported_from


def test_two_files_of_one_name_are_told_apart_and_each_is_imported_once(tmp_path, monkeypatch):
    known = ModuleType("conftest_of_two")
    known.__file__ = str(tmp_path / "another.py")
    monkeypatch.setitem(sys.modules, "conftest_of_two", known)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "conftest_of_two.py").write_text(f"FOLDER = {folder!r}\n")
        file = str(tmp_path / folder / "conftest_of_two.py")
        made = imported_from("conftest_of_two", file)
        assert folder == made.FOLDER
        assert sys.modules["conftest_of_two"] is made
        assert imported_from("conftest_of_two", file) is made
