"""The environment variables of agents: those that there were when the tests had been collected.

All tests share the episodes, and stored ones stand for driven ones, so what one test sets cannot be theirs.
"""

from __future__ import annotations

import os

import pytest

_PYTESTS = frozenset({"PYTEST_CURRENT_TEST"})
"""Variables that pytest sets for each test."""
_MOST_NAMED = 5
_COLLECTED = pytest.StashKey[dict[str, str]]()
_TOLD = pytest.StashKey[set[str]]()


def keep_environment(config: pytest.Config) -> None:
    """Take the present variables for those of the agents."""
    config.stash[_COLLECTED], config.stash[_TOLD] = dict(os.environ), set()


def environment_of(config: pytest.Config) -> dict[str, str]:
    """Return the variables of the agents, empty where nothing was collected."""
    return config.stash.get(_COLLECTED, {})


def warn_of_changes(item: pytest.Item) -> None:
    """Warn once of each variable that a test or a fixture has changed: no agent sees that."""
    before = environment_of(item.config)
    if not before:
        return
    told = item.config.stash[_TOLD]
    names = (set(before) | set(os.environ)) - _PYTESTS - told
    changed = sorted(name for name in names if before.get(name) != os.environ.get(name))
    if not changed:
        return
    told.update(changed)
    more = len(changed) - _MOST_NAMED
    named = ", ".join(changed[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
    item.warn(
        pytest.PytestWarning(
            f"drive-robust: changed since the tests were collected, and not for the agent, which drives with the "
            f"environment of then: {named}. Set it before pytest starts or as conftest.py is imported, or make it an "
            "option of the agent."
        )
    )
