"""Which of highway-env's environments can be driven here, which cannot and why, and the routes of one."""

from __future__ import annotations

import re

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint
from pytest_drive_robust.errors import RouteError, nearest

__all__ = ["refusal_of", "reset_seed", "route_of", "routes_of", "working_ids"]

_WORKING = (
    "exit-v0 exit-v1 highway-v0 highway-fast-v0 intersection-v0 intersection-v1 intersection-v2 merge-v0 merge-v1 "
    "merge-generic-v0 merge-generic-v1 racetrack-v0 racetrack-v1 racetrack-large-v0 racetrack-large-v1 "
    "racetrack-oval-v0 racetrack-oval-v1 roundabout-v0 roundabout-v1 roundabout-generic-v0 roundabout-generic-v1 "
    "two-way-v0 u-turn-v0 u-turn-v1"
).split()
_PARKING = "it has no lane to drive along and needs a reverse gear, which throttle, steer and brake do not have"
_SEVERAL = "it has several egos, and here one agent drives one"
_REFUSED = {
    "intersection-multi-agent-v0": _SEVERAL,
    "intersection-multi-agent-v1": _SEVERAL,
    "intersection-multi-agent-v2": _SEVERAL,
    "lane-keeping-v0": "it steers a car of constant speed by a step of its own, without traffic",
    "parking-v0": _PARKING,
    "parking-ActionRepeat-v0": _PARKING,
    "parking-parked-v0": _PARKING,
}
ROUTES = 10
_MOST_ROUTES = 100_000


def working_ids() -> tuple[str, ...]:
    """highway-env's ids that can be driven, sorted."""
    return tuple(sorted(_WORKING))


def refusal_of(identifier: str, *, simulator: str = "gymnasium") -> str | None:
    """Why we do not drive one of highway-env's ids, with those that work and the nearest of them; None for others."""
    reason = _REFUSED.get(identifier)
    if reason is None:
        return None
    close = nearest(identifier, _WORKING)
    instead = f"Try {close!r}. " if close else ""
    return f"{simulator}:{identifier} cannot be driven: {reason}. {instead}These work: {', '.join(working_ids())}."


def routes_of(simulator: str, identifier: str) -> tuple[Route, ...]:
    """The routes that are driven when nobody names any: `intersection-v1-0` to `-9`."""
    return tuple(route_of(simulator, identifier, number) for number in range(ROUTES))


def route_of(simulator: str, identifier: str, number: int) -> Route:
    """Route `number` of an id. Where it leads is known once it is reset: it has no waypoints."""
    scenario = ScenarioSpec(identifier, identifier, TriggerPoint(0.0, 0.0, 0.0, 0.0))
    return Route(f"{identifier}-{number}", simulator, (), scenario)


def reset_seed(route: Route, identifier: str, seed: int) -> int:
    """What the environment is reset with: the route's number + 100000 times the episode's seed.

    Raises `RouteError` for a route that is none of this environment's.
    """
    found = re.fullmatch(re.escape(identifier) + r"-(\d{1,5})", route.id)
    if found is None:
        raise RouteError(
            f"route {route.id!r} of town {route.town!r} does not fit gymnasium:{identifier}, which makes its own roads: "
            f"expected routes named {identifier}-0 to {identifier}-{_MOST_ROUTES - 1}. Leave --drive-routes out for the "
            f"first {ROUTES}."
        )
    return int(found.group(1)) + _MOST_ROUTES * seed
