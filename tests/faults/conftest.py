"""Guards for the tests of this folder, their children forked from one nursery."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from guarded_worlds import recipe

from pytest_drive_robust.engine.guard import Guard
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.nursery import Nursery

LIMITS = Limits(episode_s=20.0, act_s=0.5)


@pytest.fixture(scope="session")
def nursery() -> Iterator[Nursery]:
    made = Nursery(recipe())
    yield made
    made.close()


@pytest.fixture
def make_guard(nursery: Nursery) -> Iterator[Callable[..., Guard]]:
    """`make_guard(limits)`, or `make_guard(limits, simulator, ...)` for one with a nursery of its own."""
    guards: list[Guard] = []
    nurseries: list[Nursery] = []

    def make(limits: Limits = LIMITS, simulator: str | None = None, **changes: object) -> Guard:
        if simulator is not None:
            nurseries.append(Nursery(recipe(simulator, **changes)))
        guards.append(Guard(nurseries[-1] if simulator is not None else nursery, limits))
        return guards[-1]

    yield make
    for guard in guards:
        guard.close()
    for own in nurseries:
        own.close()


@pytest.fixture
def guard(make_guard: Callable[..., Guard]) -> Guard:
    return make_guard()
