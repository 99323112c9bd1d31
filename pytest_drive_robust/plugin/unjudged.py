"""Finds the requirement that a test has as a parameter and ended without judging: such a test must not pass."""

from __future__ import annotations

import inspect

import pytest

from pytest_drive_robust.plugin.drive_marker import marker_options
from pytest_drive_robust.plugin.fixtures import DRIVE_CONTEXT, definitions_of, uses_drive
from pytest_drive_robust.plugin.requirement_place import requirements_of
from pytest_drive_robust.plugin.verdict_errors import NotJudgedError

ANSWERED = pytest.StashKey[set[str]]()
"""In `item.stash`: the requirements that `drive` judged for the test, and the settings that it measured for it."""
JUDGES_LATER = pytest.StashKey[bool]()
"""In `item.stash`: True after a body that left its requirement to a fixture, which may judge it after its `yield`."""


def left_unjudged(item: pytest.Item, when: str) -> NotJudgedError | None:
    """Return the error of a test that passed without judging a requirement of its parameters; None for other tests.

    A test judges a requirement by `drive.check` or `drive.minimal`, wherever they are called, or measures its setting
    and asserts on its own. `when` is the phase that ended: `"call"`, but `"teardown"` where a fixture may still judge.
    """
    has_ended = when == "call" or (when == "teardown" and item.stash.get(JUDGES_LATER, False))
    if not has_ended or not uses_drive(item):
        return None
    reading = marker_options(item).asked_reading(item.config.stash[DRIVE_CONTEXT].options.asked_reading)
    answered = item.stash.get(ANSWERED, set())
    for name, stated in requirements_of(item).items():
        asked = stated.read_as(reading)
        if answered & {str(asked), str(asked.setting)}:
            continue
        if when == "call" and _has_fixture_that_may_judge(item):
            item.stash[JUDGES_LATER] = True
            return None
        return NotJudgedError(stated, f"the test ended without judging it. Call drive.check({name}), or skip the test.")
    return None


def _has_fixture_that_may_judge(item: pytest.Item) -> bool:
    """Return True when a fixture of the test requests `drive` and goes on after its `yield`."""
    return any(
        "drive" in definition.argnames and inspect.isgeneratorfunction(definition.func)
        for definitions in (definitions_of(item) or {}).values()
        for definition in definitions
    )
