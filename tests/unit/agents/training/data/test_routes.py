"""Training and validation routes are never the routes that agents are judged on."""

from __future__ import annotations

import re

import numpy as np
import pytest

from drive_robust_agents.training.data.routes import (
    SCENARIO_NAMES,
    TRAINING_SEEDS,
    VALIDATION_SEED,
    draw,
    training_keys,
    validation_keys,
)
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.embedded.generate import TOWNS_PER_SEED
from pytest_drive_robust.simulators.embedded.route_sets import named_routes


def town_number(route: Route) -> int:
    return int(re.search(r"\d+$", route.town)[0])


def line(route: Route) -> np.ndarray:
    return np.array([(point.x_m, point.y_m) for point in route.waypoints])


@pytest.fixture(scope="module")
def training() -> list[Route]:
    """One of every second type, with numbers all over the range."""
    keys = training_keys(seed=1, per_type=20)
    drawn = [draw(keys[44 * (tag % 20) + tag]) for tag in range(0, 44, 2)]
    return [route for route in drawn if route is not None]


def test_the_towns_of_evaluation_and_of_every_training_seed_have_numbers_that_never_meet() -> None:
    evaluation = {town_number(route) for route in named_routes("full")}
    assert max(evaluation) <= TOWNS_PER_SEED  # the generator gives seed s the numbers above 1000 s
    assert min(TRAINING_SEEDS) >= 1
    assert VALIDATION_SEED not in TRAINING_SEEDS


def test_training_routes_lie_in_towns_of_their_own(training: list[Route]) -> None:
    assert len(training) >= 21
    assert all(TOWNS_PER_SEED < town_number(route) <= 2 * TOWNS_PER_SEED for route in training)
    assert not {route.town for route in training} & {route.town for route in named_routes("full")}


def test_no_training_route_runs_along_an_evaluation_route(training: list[Route]) -> None:
    judged = [line(route) for route in named_routes("full")]
    for route in training:
        mine = line(route)
        assert not any(len(mine) == len(other) and np.allclose(mine, other, atol=0.1) for other in judged)


def test_no_route_has_the_id_of_an_evaluation_route_or_of_another_one() -> None:
    keys = (*training_keys(seed=1), *training_keys(seed=2), *validation_keys(per_type=20))
    ids = [key.id for key in keys]
    assert len(set(ids)) == len(ids)
    assert not set(ids) & {route.id for route in named_routes("full")}


def test_every_first_part_of_the_keys_holds_all_types_in_equal_shares() -> None:
    keys = training_keys(seed=3, per_type=5)
    assert len(keys) == 220
    assert sorted(key.tag for key in keys[:88]) == sorted([*range(44)] * 2)
    assert len(SCENARIO_NAMES) == 44


def test_validation_routes_are_drawn_by_a_seed_of_their_own() -> None:
    routes = [draw(key) for key in validation_keys()[::6]]
    assert None not in routes
    low = TOWNS_PER_SEED * VALIDATION_SEED
    assert all(low < town_number(route) <= low + TOWNS_PER_SEED for route in routes)


@pytest.mark.parametrize("seed", [0, VALIDATION_SEED, -1])
def test_the_seeds_of_evaluation_and_validation_draw_no_training_routes(seed: int) -> None:
    with pytest.raises(UsageError, match=f"route seed {seed} draws no training routes: expected 1 to"):
        training_keys(seed=seed)


@pytest.mark.parametrize("per_type", [0, 100])
def test_numbers_that_cannot_be_drawn_are_refused(per_type: int) -> None:
    with pytest.raises(UsageError, match="expected 1 to 99"):
        training_keys(per_type=per_type)


def test_some_types_alone_have_the_routes_that_they_have_among_all() -> None:
    names = ("Accident", "ParkingExit")
    some = training_keys(per_type=3, types=names)
    assert [SCENARIO_NAMES[key.tag] for key in some] == [*names] * 3
    assert some == tuple(key for key in training_keys(per_type=3) if SCENARIO_NAMES[key.tag] in names)
    with pytest.raises(UsageError, match="Did you mean 'ParkingExit'"):
        training_keys(types=["ParkingExits"])
