"""Keeps the environment variables of agents: the variables that were set when collection ended.

All tests share episodes, and a stored episode replaces a driven one, so no test may set a variable for an agent.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import pytest

from pytest_drive_robust.errors import first_few

_MOST_NAMED = 5


class _Variables(NamedTuple):
    """The environment variables at the end of collection. A change that a test makes does not reach the agents.

    `collected` holds the variables that agents get. `known` holds `collected` plus the changes made while driving,
    because some libraries set variables when they are loaded. `told` holds the names that were warned about.
    """

    collected: dict[str, str]
    known: dict[str, str]
    told: set[str]


_VARIABLES = pytest.StashKey[_Variables]()


def keep_environment(config: pytest.Config) -> None:
    """Keep the present variables as the variables of the agents."""
    pytests = {"PYTEST_CURRENT_TEST"}  # pytest sets it for each test
    config.stash[_VARIABLES] = _Variables(dict(os.environ), dict(os.environ), pytests)


def environment_of(config: pytest.Config) -> dict[str, str]:
    """Return the variables of the agents; empty before collection has ended."""
    variables = config.stash.get(_VARIABLES, None)
    return {} if variables is None else variables.collected


@contextmanager
def variables_of_tests_told(item: pytest.Item) -> Iterator[None]:
    """Warn once of each variable that a test or a fixture has changed: no agent sees that. Then drive in the body."""
    variables = item.config.stash.get(_VARIABLES, None)
    if variables is not None:
        changed = [name for name in _changed(variables.known) if name not in variables.told]
        if changed:
            variables.told.update(changed)
            item.warn(pytest.PytestWarning(_told(changed)))
    with variables_of_driving_known(item.config):
        yield


@contextmanager
def variables_of_driving_known(config: pytest.Config) -> Iterator[None]:
    """Count variables that change in the body as changed by driving, not by a test."""
    variables = config.stash.get(_VARIABLES, None)
    if variables is None:
        yield
        return
    before = dict(os.environ)
    try:
        yield
    finally:
        for name in _changed(before):
            variables.known.pop(name, None)
            if name in os.environ:
                variables.known[name] = os.environ[name]


def _changed(before: dict[str, str]) -> list[str]:
    return sorted(name for name in before.keys() | os.environ.keys() if before.get(name) != os.environ.get(name))


def _told(changed: list[str]) -> str:
    named = first_few(changed, _MOST_NAMED)
    return (
        f"drive-robust: environment variables changed after the tests were collected: {named}. The agent does not see "
        "the change. Set a variable before pytest starts or while conftest.py is imported, or make it an option of "
        "the agent."
    )
