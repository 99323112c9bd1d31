"""The first run on a machine says that it compiles, and how much is left; later runs have nothing to compile."""

from __future__ import annotations

import re
import shutil

import pytest

from pytest_drive_robust.jit.cache import cache_folder

MOST_FUNCTIONS = 90
"""`expert` waits for so many at most, of the 140 that all agents and cameras need together."""

SUITE = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements("DS under clean >= 1"))
class TestBoth:
    @pytest.mark.drive_robust(agent="expert")
    def test_without_cameras(self, drive, requirement):
        drive.check(requirement)

    def test_with_whatever_it_says_nothing_of(self, drive, requirement):
        drive.check(requirement)
"""


@pytest.mark.slow
def test_the_first_run_says_how_many_functions_are_compiled_and_drives_before_all_are(suite, pytester, monkeypatch):
    known = pytester.path / "compiled" / "pytest-drive-robust"
    known.mkdir(parents=True)
    for file in cache_folder().glob("entry_points.draw_camera-*"):  # nobody waits for it, and it takes the longest
        shutil.copy(file, known)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(known.parent))
    folder = suite(test=SUITE)
    options = ("--drive-robust", "--drive-sim", "embedded", "--drive-agent", "steady", "--drive-routes", "801")
    said = []
    for number in range(2):
        result = folder.runpytest_subprocess(
            *options, "--drive-executor", "processes", "--drive-store", str(pytester.path / f"store {number}")
        )
        assert result.ret == 0
        lines = [re.match(r"drive-robust: compiling, (\d+) of (\d+) functions done", line) for line in result.outlines]
        said.append([(int(found[1]), int(found[2])) for found in lines if found])
    first, second = said
    assert first[0][0] < first[0][1]
    assert 20 <= first[0][1] <= MOST_FUNCTIONS
    assert first == sorted(first, key=lambda told: (told[1] != first[0][1], told[0]))
    assert second == []
