"""`--drive-probe`: does one seed suffice?"""

from __future__ import annotations

import json

import pytest

MOODY = """
import itertools
MOODS = itertools.count()

def moody():
    share = 0.8 + 0.02 * next(MOODS)
    return ScriptedAgent([Control(throttle=1.0)] * 20 + [Control(throttle=share)])

AGENTS.append(moody)
"""
TEST = "DS under clean >= 50"


def run(folder, *args):
    return folder.runpytest_inprocess("--drive-robust", "--drive-probe", "--drive-json", "run.json", *args)


def notes(folder):
    return json.loads((folder.path / "run.json").read_text())["notes"]


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_an_agent_that_repeats_itself_needs_one_seed(suite, workers):
    folder = suite(TEST)
    result = run(folder, "--drive-seeds", "4,5", *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        ["drive-robust: probe: steady drove route 1 clean twice with seed 4: the same 5? ticks bit for bit, *"]
    )
    (note,) = notes(folder)
    assert note.endswith("one seed suffices to repeat a run")


def test_an_agent_that_does_not_is_told_when_and_how_far_its_drives_part(suite):
    folder = suite(TEST, conftest=MOODY)
    run(folder, "--drive-agent", "moody")
    (note,) = notes(folder)
    assert "not the same from 1.05 s on, up to 0.0" in note
    assert "driving scores 100.00 and 100.00. One seed does not repeat a run" in note


def test_a_world_that_breaks_teaches_nothing(suite):
    folder = suite(TEST)
    run(folder, "--drive-sim", "broken")
    (note,) = notes(folder)
    assert "the simulation broke, so nothing was learned" in note


def test_looking_only_drives_nothing(suite, driven):
    result = run(suite(TEST), "--collect-only")
    result.stdout.no_fnmatch_line("*probe:*")
    assert driven() == []


def test_without_the_option_there_is_no_probe(suite, driven):
    suite(TEST).runpytest_inprocess("--drive-robust")
    assert driven() == ["1 0", "2 0", "3 0"]
