"""Named sets of the routes that we ship, all in one file.

The file holds every scenario type in alphabetical order with the same number of routes each; the ids are
100 for the first type, 200 for the second, ..., plus 1, 2, ... for its routes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.simulators.embedded.route_xml import load_routes

_FOLDER = Path(__file__).parent / "route_files"
_FILE = _FOLDER / "full.xml"

ALL_ROUTES = "full"
"""The set in which route ids without a set or file are looked up."""

DEFAULT_SET = "one-per-scenario"

_DEV10 = frozenset(
    (
        "BlockedIntersection",
        "ConstructionObstacleTwoWays",
        "HazardAtSideLane",
        "NonSignalizedJunctionLeftTurn",
        "ParkingCrossingPedestrian",
        "ParkingExit",
        "SequentialLaneChange",
        "SignalizedJunctionLeftTurnEnterFlow",
        "StaticCutIn",
        "YieldToEmergencyVehicle",
    )
)
"""The types of Bench2Drive's Dev10: `leaderboard/data/drivetransformer_bench2drive_dev10.xml`."""

_SETS: dict[str, tuple[str, Callable[[Route, int], bool]]] = {
    "dev10": (
        "the first of each type of Bench2Drive's Dev10",
        lambda route, n: n == 0 and route.scenario.type in _DEV10,
    ),
    "full": ("all of them", lambda route, n: True),
    "one-per-scenario": ("the first of each scenario type", lambda route, n: n == 0),
}
"""By name of the set: its content in words, and a predicate of (route, its number among the routes of its type)."""


def set_names() -> tuple[str, ...]:
    """Return the names that `named_routes` knows."""
    return tuple(sorted(_SETS))


def set_summary(name: str) -> str:
    """Return the content of a set in words. Raises `UnknownNameError`."""
    return _find(name)[0]


def named_routes(name: str) -> tuple[Route, ...]:
    """Return the routes of a set that we ship, by scenario type and number. Raises `UnknownNameError`."""
    belongs = _find(name)[1]
    seen: dict[str, int] = {}
    chosen = []
    for route in _shipped():
        number = seen.get(route.scenario.type, 0)
        seen[route.scenario.type] = number + 1
        if belongs(route, number):
            chosen.append(route)
    return tuple(chosen)


def is_shipped(route: Route) -> bool:
    """Return whether a route equals a route that we ship in every field."""
    return route in _shipped()


def _find(name: str) -> tuple[str, Callable[[Route, int], bool]]:
    if name not in _SETS:
        raise UnknownNameError.of("set of routes", name, _SETS, hint="Or give the path of a route XML file.")
    return _SETS[name]


@lru_cache(maxsize=1)
def _shipped() -> tuple[Route, ...]:
    """Return every route that we ship: parsed once in a process, in well under a tenth of a second."""
    return load_routes(_FILE, is_ours=True)
