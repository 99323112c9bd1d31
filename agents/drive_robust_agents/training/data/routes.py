"""Routes for training and for choosing checkpoints: drawn like the 220 evaluation routes, but never these routes.

The generator draws from (seed, scenario type, number), and every seed has its own towns. Evaluation routes have seed 0,
training routes the seeds `TRAINING_SEEDS`, validation routes `VALIDATION_SEED`.
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
    """The key of a drawn route: generator seed, index of the scenario type in `SCENARIO_NAMES`, number."""

    seed: int
    tag: int
    number: int

    @property
    def id(self) -> str:
        """The route id, as `"1-203"`. No evaluation route has such an id, so even a scenario's own draws differ."""
        return f"{self.seed}-{100 * (self.tag + 1) + self.number + 1}"


def training_keys(*, seed: int = 1, per_type: int = 20, types: Collection[str] = ()) -> tuple[RouteKey, ...]:
    """Return `per_type` routes of each of `types` (empty: all types), ordered so that any prefix has equal shares.

    Raises `UsageError` for the seeds of evaluation and validation, and for impossible numbers and types.
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
    """Return the keys of routes for neither training nor evaluation. Raises `UsageError` for an impossible number."""
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
