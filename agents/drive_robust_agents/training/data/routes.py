"""The routes to learn from and to choose checkpoints on: drawn like the 220 that agents are judged on, never those.

The generator draws from (seed, scenario type, number), and every seed has towns of its own. Evaluation routes are of
seed 0; training routes are of the seeds `TRAINING_SEEDS`, validation routes of `VALIDATION_SEED`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import RouteError, UnknownNameError, UsageError
from pytest_drive_robust.simulators.embedded.generate import draw_route
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS

__all__ = [
    "MOST_PER_TYPE", "SCENARIO_NAMES", "TRAINING_SEEDS", "VALIDATION_SEED", "RouteKey", "draw", "training_keys",
    "validation_keys", "validation_routes",
]  # fmt: skip

TRAINING_SEEDS = range(1, 900)
VALIDATION_SEED = 901
MOST_PER_TYPE = 99
SCENARIO_NAMES = tuple(sorted(SCENARIOS))
"""The scenario types in sorted order: the column `tag` of a sample is an index into them."""


@dataclass(frozen=True, slots=True)
class RouteKey:
    """What names a drawn route: seed of the generator, index of the scenario type in `SCENARIO_NAMES`, its number."""

    seed: int
    tag: int
    number: int

    @property
    def id(self) -> str:
        """`"1-203"`: no evaluation route has such an id, so not even a scenario's own draws are the same."""
        return f"{self.seed}-{100 * (self.tag + 1) + self.number + 1}"


def training_keys(*, seed: int = 1, per_type: int = 20, types: Collection[str] = ()) -> tuple[RouteKey, ...]:
    """Return `per_type` routes of each of these types (none: of all); any first part holds the types in equal shares.

    Raises `UsageError` for the seeds of evaluation and validation, and for numbers and types that cannot be drawn.
    """
    for name in types:
        if name not in SCENARIOS:
            raise UnknownNameError.of("scenario type", name, SCENARIO_NAMES)
    if seed not in TRAINING_SEEDS:
        raise UsageError(
            f"route seed {seed} draws no training routes: expected {TRAINING_SEEDS[0]} to {TRAINING_SEEDS[-1]}. "
            f"Seed 0 drew the routes that agents are judged on, {VALIDATION_SEED} those that choose checkpoints."
        )
    return tuple(key for key in _keys(seed, per_type) if not types or SCENARIO_NAMES[key.tag] in types)


def validation_keys(*, per_type: int = 1) -> tuple[RouteKey, ...]:
    """Return routes that are neither trained nor judged on. Raises `UsageError` for a number that cannot be drawn."""
    return _keys(VALIDATION_SEED, per_type)


def validation_routes(*, per_type: int = 1) -> tuple[Route, ...]:
    """Return the routes of `validation_keys` that can be laid."""
    return tuple(route for route in map(draw, validation_keys(per_type=per_type)) if route is not None)


def draw(key: RouteKey) -> Route | None:
    """Return the route of a key, or None where the generator finds no place for its scenario."""
    kind = SCENARIOS[SCENARIO_NAMES[key.tag]]
    try:
        return draw_route(kind, number=key.number, seed=key.seed, route_id=key.id)
    except RouteError:
        return None


def _keys(seed: int, per_type: int) -> tuple[RouteKey, ...]:
    if not 1 <= per_type <= MOST_PER_TYPE:
        raise UsageError(f"{per_type} routes per scenario type: expected 1 to {MOST_PER_TYPE}.")
    return tuple(RouteKey(seed, tag, number) for number in range(per_type) for tag in range(len(SCENARIO_NAMES)))
