"""Code that a worker process loads when the run is long under way: edited by then, it drives under no key of before."""

from __future__ import annotations

import pytest

from pytest_drive_robust.store.maintenance import statistics

AGENT = """
from pytest_drive_robust import Control
from pytest_drive_robust.testing import ScriptedAgent


class Own(ScriptedAgent):
    def reset(self, route, seed):
        if seed == 1:
            import late
        super().reset(route, seed)


def own():
    return Own([Control(throttle=1.0)])
"""
TESTS = """
from pathlib import Path

import pytest
from pytest_drive_robust import requirements

(REQUIREMENT,) = requirements("DS under clean >= 1")


def test_early(drive):
    drive.check(REQUIREMENT)


@pytest.mark.drive_robust(seeds=[1])
def test_late(drive):
    {edit}
    drive.check(REQUIREMENT)
"""
EDIT = 'Path(__file__).with_name("late.py").write_text("THROTTLE = 0.3")'


@pytest.mark.parametrize(("edit", "late"), [(EDIT, "errors"), ("pass", "passed")], ids=["edited", "as it was"])
def test_what_was_edited_before_a_worker_loaded_it_is_not_stored(suite, driven, edit, late):
    folder = suite(test=TESTS.format(edit=edit))
    folder.makepyfile(agent=AGENT, late="THROTTLE = 1.0")
    asked = ("--drive-executor=processes", "--drive-workers=1", "--drive-agent=agent:own")
    result = folder.runpytest_subprocess("--drive-robust", *asked)
    result.assert_outcomes(**({"passed": 1, "errors": 1} if late == "errors" else {"passed": 2}))
    if late == "errors":
        result.stdout.fnmatch_lines(["late.py changed after the tests were collected, and a worker process *"])
    assert len(driven()) >= 4
    assert statistics(folder.path / ".drive-robust").records == (3 if late == "errors" else 6)
