"""Fixtures `drive` and `drive_agent`. Every session imports this module; `plugin.judging` contains what drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pytest_drive_robust.plugin.judging import Drive, DriveContext

NEEDS_FLAG = "needs --drive-robust"
DRIVE_CONTEXT = pytest.StashKey["DriveContext"]()
"""In `config.stash` only where `--drive-robust` was given and this process drives."""
_FIXTURES = frozenset({"drive", "drive_agent"})


@pytest.fixture
def drive(request: pytest.FixtureRequest) -> Drive:
    """Judge requirements on closed-loop episodes: `drive.check(requirement)`, `drive.rd(setting) <= 0.30`."""
    return _context(request).drive_for(request.node)


@pytest.fixture
def drive_agent(request: pytest.FixtureRequest) -> str:
    """Return the name of the agent under test: --drive-agent, or what the test's marker says."""
    return _context(request).drive_for(request.node).agent


def _context(request: pytest.FixtureRequest) -> DriveContext:
    context = request.config.stash.get(DRIVE_CONTEXT, None)
    if context is None:
        pytest.skip(NEEDS_FLAG)
    return context


def uses_drive(item: pytest.Item) -> bool:
    """Return True for a test that uses our `drive` or `drive_agent`, directly or through another fixture.

    A project may have its own fixture named `drive`, for a disk or a robot: a test with that fixture returns False.
    """
    known = definitions_of(item)
    asked = _FIXTURES.intersection(getattr(item, "fixturenames", ()))
    return any(known is None or _is_ours(name, known.get(name, ())) for name in asked)


def definitions_of(item: pytest.Item) -> Mapping[str, Sequence[pytest.FixtureDef[Any]]] | None:
    """Return the fixtures of a test by name, overridden ones first; None where pytest does not tell."""
    return getattr(getattr(item, "_fixtureinfo", None), "name2fixturedefs", None)


def _is_ours(name: str, definitions: Sequence[pytest.FixtureDef[Any]]) -> bool:
    """Return whether the last of `definitions` is our fixture, or overrides ours and requests it."""
    for definition in reversed(definitions):
        if definition.func.__module__ == __name__:
            return True
        if name not in definition.argnames:
            return False
    return False
