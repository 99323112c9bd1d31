"""Which of highway-env's environments can be driven here, which cannot and why, and the routes of one."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint
from pytest_drive_robust.errors import RouteError, UnknownNameError

__all__ = ["ROUTES", "refusal_of", "reset_seed", "routes_of", "working_ids"]

ROUTES = 10
"""So many routes are driven when nobody names any."""
_MOST_ROUTES = 100_000
_WORKING = (
    *("exit-v0", "exit-v1", "highway-v0", "highway-fast-v0", "intersection-v0", "intersection-v1", "intersection-v2"),
    *("merge-v0", "merge-v1", "merge-generic-v0", "merge-generic-v1", "racetrack-v0", "racetrack-v1"),
    *("racetrack-large-v0", "racetrack-large-v1", "racetrack-oval-v0", "racetrack-oval-v1", "roundabout-v0"),
    *("roundabout-v1", "roundabout-generic-v0", "roundabout-generic-v1", "two-way-v0", "u-turn-v0", "u-turn-v1"),
)
_PARKING = "it has no lane to drive along and needs a reverse gear, which throttle, steer and brake do not have"
_SEVERAL = "it has several egos, and here one agent drives one"
_OWN_STEP = "it steers a car of constant speed by a step of its own, without traffic"
_REFUSED = {
    "intersection-multi-agent-v0": (_SEVERAL, "gymnasium:intersection-v0"),
    "intersection-multi-agent-v1": (_SEVERAL, "gymnasium:intersection-v1"),
    "intersection-multi-agent-v2": (_SEVERAL, "gymnasium:intersection-v2"),
    "lane-keeping-v0": (_OWN_STEP, "gymnasium:racetrack-v0"),
    "parking-v0": (_PARKING, "gymnasium:roundabout-v0"),
    "parking-ActionRepeat-v0": (_PARKING, "gymnasium:roundabout-v0"),
    "parking-parked-v0": (_PARKING, "gymnasium:roundabout-v0"),
}
"""Why not, and the nearest that can."""


def working_ids() -> tuple[str, ...]:
    """Return highway-env's ids that can be driven, sorted."""
    return tuple(sorted(_WORKING))


def refusal_of(identifier: str) -> str | None:
    """Return why we do not drive one of highway-env's ids, with those that work and the nearest of them.

    None for others.
    """
    if identifier not in _REFUSED:
        return None
    reason, instead = _REFUSED[identifier]
    working = ", ".join(working_ids())
    return f"gymnasium:{identifier} cannot be driven: {reason}. The nearest is {instead}. With gymnasium: {working}."


def routes_of(simulator: str, identifier: str, names: Sequence[str] = ()) -> tuple[Route, ...]:
    """Return the routes of those names, each once; without names `intersection-v1-0` to `-9`.

    Where a route leads is known once it is reset: it has no waypoints. Raises `UnknownNameError`.
    """
    wanted = names or [f"{identifier}-{number}" for number in range(ROUTES)]
    for name in wanted:
        if _number(name, identifier) is None:
            known = [f"{identifier}-{number}" for number in range(ROUTES)]
            hint = f"Any number up to {_MOST_ROUTES - 1} will do."
            raise UnknownNameError.of(f"route of {simulator}", name, known, hint=hint)
    scenario = ScenarioSpec(identifier, identifier, TriggerPoint(0.0, 0.0, 0.0, 0.0))
    return tuple(Route(name, simulator, (), scenario) for name in dict.fromkeys(wanted))


def reset_seed(route: Route, seed: int, *, simulator: str, identifier: str) -> int:
    """Return what the environment is reset with: the route's number + 100000 times the episode's seed.

    Raises `RouteError` for a route that is none of this environment's.
    """
    number = _number(route.id, identifier)
    if number is None:
        raise RouteError(
            f"route {route.label!r} is for town {route.town!r} and does not fit {simulator}, which makes its own "
            f"roads: give --drive-routes {simulator} for its first {ROUTES} routes, or some of {identifier}-0 to "
            f"{identifier}-{_MOST_ROUTES - 1} by name"
        )
    return number + _MOST_ROUTES * seed


def _number(name: str, identifier: str) -> int | None:
    found = re.fullmatch(re.escape(identifier) + r"-(0|[1-9]\d{0,4})", name)
    return None if found is None else int(found.group(1))
