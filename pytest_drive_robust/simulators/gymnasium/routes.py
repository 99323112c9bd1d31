"""The routes of an environment: resets with numbered seeds, `merge-v0-0`, `merge-v0-1`, ..."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint
from pytest_drive_robust.errors import RouteError, UnknownNameError

_ROUTES = 10
"""Number of routes that are driven when no route is named."""
_MOST_ROUTES = 100_000


def routes_of(simulator: str, identifier: str, names: Sequence[str] = ()) -> tuple[Route, ...]:
    """Return the routes of the given names, each once; without names `ID-0` to `ID-9`.

    A route has no waypoints, because its way is known only after the reset. Raises `UnknownNameError`.
    """
    usual = [f"{identifier}-{number}" for number in range(_ROUTES)]
    wanted = names or usual
    for name in wanted:
        if _number(name, identifier) is None:
            hint = f"Any number up to {_MOST_ROUTES - 1} will do."
            raise UnknownNameError.of(f"route of {simulator}", name, usual, hint=hint)
    scenario = ScenarioSpec(identifier, identifier, TriggerPoint(0.0, 0.0, 0.0, 0.0))
    return tuple(Route(name, simulator, (), scenario) for name in dict.fromkeys(wanted))


def reset_seed(route: Route, seed: int, *, simulator: str, identifier: str) -> int:
    """Return the reset's seed: the route's number + 100000 times the episode's. Raises `RouteError` for another."""
    number = _number(route.id, identifier)
    if number is None:
        raise RouteError(
            f"route {route.label!r} is for town {route.town!r} and does not fit {simulator}, which makes its own "
            f"roads: give --drive-routes {simulator} for its first {_ROUTES} routes, or some of {identifier}-0 to "
            f"{identifier}-{_MOST_ROUTES - 1} by name"
        )
    return number + _MOST_ROUTES * seed


def _number(name: str, identifier: str) -> int | None:
    found = re.fullmatch(re.escape(identifier) + r"-(0|[1-9]\d{0,4})", name)
    return None if found is None else int(found.group(1))
