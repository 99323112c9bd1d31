"""pytest rewrites the asserts of installed plugins: not of what we load with `--drive-robust`, and of all others."""

from __future__ import annotations

import gc
import subprocess
import sys

from pytest_drive_robust.plugin.quick_import import quick_import

CONFTEST = """
import sys

def pytest_unconfigure():
    ours = [sys.modules[f"pytest_drive_robust.{name}"] for name in ("plugin.activation", "runner.campaign", "stats")]
    print("REWRITTEN", *(one.__name__ for one in ours if "Rewriting" in type(one.__loader__).__name__))
    print("LOADED", len(ours))
"""


def test_nothing_of_ours_is_rewritten_and_tests_are(tmp_path, plugin_args):
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_it.py").write_text("def test_it():\n    assert [1, 2] == [1, 3]\n")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *plugin_args, "--drive-robust"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "At index 1 diff: 2 != 3" in done.stdout, done.stdout + done.stderr
    lines = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if line.strip()}
    assert lines["REWRITTEN"] == []
    assert lines["LOADED"] == ["3"]


def test_everything_is_as_it_was_afterwards():
    finders, collects = list(sys.meta_path), gc.isenabled()
    with quick_import():
        assert not gc.isenabled()
        assert len(sys.meta_path) < len(finders)
    assert sys.meta_path == finders
    assert gc.isenabled() == collects
