"""The first run on a machine says that it compiles, and how much is left; later runs have nothing to compile."""

from __future__ import annotations

import re

import pytest


@pytest.mark.slow
def test_the_first_run_says_how_many_functions_are_compiled(suite, pytester, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(pytester.path / "compiled"))
    folder = suite("DS under clean >= 1")
    options = ("--drive-robust", "--drive-sim", "embedded", "--drive-agent", "steady", "--drive-routes", "dev10")
    said = []
    for number in range(2):
        result = folder.runpytest_subprocess(
            *options, "--drive-executor", "processes", "--drive-store", str(pytester.path / f"store {number}")
        )
        assert result.ret == 0
        lines = [re.match(r"drive-robust: compiling, (\d+) of (\d+) functions done", line) for line in result.outlines]
        said.append([(int(found[1]), int(found[2])) for found in lines if found])
    first, second = said
    assert first[0][0] < first[0][1] >= 20
    assert first == sorted(first)
    assert len({total for _, total in first}) == 1
    assert second == []
