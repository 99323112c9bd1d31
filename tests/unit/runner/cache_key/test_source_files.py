from __future__ import annotations

import sys
from types import ModuleType

import pytest

from pytest_drive_robust.runner.cache_key.source_files import UnknownSourceError, code_digest


def test_code_that_cannot_be_found_has_no_digest(tmp_path):
    moved = ModuleType("moved")
    moved.__file__ = str(tmp_path / "moved.py")
    with pytest.raises(UnknownSourceError, match=r"moved\.py"):
        code_digest([moved])


def test_every_file_of_a_package_counts_in_its_digest(module, tmp_path):
    module("driving_pkg.__init__", "")
    package = sys.modules["driving_pkg"]
    first = code_digest([package])
    (tmp_path / "driving_pkg" / "inner").mkdir()
    (tmp_path / "driving_pkg" / "inner" / "tables.py").write_text("LIMIT = 5\n")
    assert code_digest([package]) != first
