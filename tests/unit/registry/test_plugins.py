from __future__ import annotations

import sys
from types import ModuleType

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.plugins import imported_from, register_names_of
from pytest_drive_robust.registry.registry import Registry


@pytest.fixture
def fresh_imports(monkeypatch):
    """Take back what a test adds to `sys.path` and `sys.modules`."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "modules", dict(sys.modules))


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


def test_a_file_that_raises_is_not_taken_for_imported(tmp_path, fresh_imports):
    (tmp_path / "half_plugin.py").write_text("BEGUN = True\nraise ValueError('half')\n")
    for _ in range(2):
        with pytest.raises(ValueError, match="half"):
            imported_from("half_plugin", str(tmp_path / "half_plugin.py"))
    assert "half_plugin" not in sys.modules


def test_a_file_is_the_same_by_a_link_to_its_folder(tmp_path, fresh_imports):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "linked_plugin.py").write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    made = imported_from("linked_plugin", str(tmp_path / "real" / "linked_plugin.py"))
    assert imported_from("linked_plugin", str(tmp_path / "link" / "linked_plugin.py")) is made


def test_a_file_in_packages_is_imported_by_its_whole_name_and_finds_its_neighbours(tmp_path, fresh_imports):
    inner = tmp_path / "outer_suites" / "inner_suites"
    inner.mkdir(parents=True)
    for folder in (inner.parent, inner):
        (folder / "__init__.py").write_text("")
    (inner / "agents.py").write_text("class Mine: pass\n")
    (inner / "conftest.py").write_text(
        "from .agents import Mine\ndef pytest_drive_robust_register(registry): registry.register_agent('mine', Mine)\n"
    )
    registry = Registry()
    register_names_of(str(inner / "conftest.py"), registry)
    assert registry.entry("agents", "mine").load() is sys.modules["outer_suites.inner_suites.agents"].Mine
    assert str(tmp_path) in sys.path


def test_a_hook_need_not_take_the_registry_and_one_that_raises_is_told_by_its_last_own_line(tmp_path, fresh_imports):
    quiet, loud = tmp_path / "quiet_plugin.py", tmp_path / "loud_plugin.py"
    quiet.write_text("called = []\ndef pytest_drive_robust_register():\n    called.append(1)\n")
    register_names_of(str(quiet), Registry())
    assert sys.modules["quiet_plugin"].called == [1]
    loud.write_text("def helper():\n    return {}['no']\n\ndef pytest_drive_robust_register(registry):\n    helper()\n")
    with pytest.raises(UsageError, match=r"raised KeyError: 'no' \(.*loud_plugin\.py:2\)"):
        register_names_of(str(loud), Registry())
