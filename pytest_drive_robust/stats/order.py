"""In which order routes are driven, and how results that finish in any order are read in it.

A verdict may stop early only on a finished prefix of an order that was fixed before: whoever stops on what finished
first stops on the routes that are quick, and those are the ones that went well.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import Generic, TypeVar

__all__ = ["PrefixReader", "planned_order"]

Result = TypeVar("Result")

_MOST_DROPPED = 0.05


def planned_order(route_ids: Sequence[str], scenario_types: Sequence[str], seed_text: str) -> tuple[str, ...]:
    """The routes shuffled by `seed_text`, spread so that every stretch holds its share of each scenario type.

    With equally many routes of each type these are blocks with one route of each, shuffled within and between;
    otherwise a type with twice the routes comes twice as often from start to end. The same on every machine and
    whatever the order of the arguments; another text gives another order. Use the id of the suite or the requirement
    as text, never the time.

    Raises `ValueError` when a route has no type or comes twice.
    """
    if len(route_ids) != len(scenario_types):
        raise ValueError(f"{len(route_ids)} routes and {len(scenario_types)} scenario types. Expected one for each.")
    if len(set(route_ids)) != len(route_ids):
        twice = sorted({route for route in route_ids if list(route_ids).count(route) > 1})
        raise ValueError(f"these routes come twice: {', '.join(twice)}. Expected every route once.")
    of_type: dict[str, list[tuple[float, str]]] = {}
    for route, scenario_type in zip(route_ids, scenario_types, strict=True):
        of_type.setdefault(scenario_type, []).append((_draw(seed_text, "choice", route), route))
    places: list[tuple[float, str]] = []
    for routes in of_type.values():
        for number, (_, route) in enumerate(sorted(routes)):
            places.append(((number + _draw(seed_text, "place", route)) / len(routes), route))
    return tuple(route for _, route in sorted(places))


def _draw(*texts: str) -> float:
    """A number in 0..1 named by texts: the same in every process, unlike `hash()`."""
    digest = hashlib.sha256("\x00".join(texts).encode("utf-8", "surrogatepass")).digest()
    return int.from_bytes(digest[:6], "big") / 2.0**48


class PrefixReader(Generic[Result]):
    """Takes results as they finish and gives them back in planned order, as far as that is finished without a gap."""

    def __init__(self, planned: Iterable[str]) -> None:
        self._planned = tuple(planned)
        self._places = {route: place for place, route in enumerate(self._planned)}
        if len(self._places) != len(self._planned):
            raise ValueError("a route comes twice in the planned order. Expected every route once.")
        self._finished: dict[str, tuple[Result, ...]] = {}
        self._read = 0
        self._dropped: set[str] = set()

    def finish(self, route: str, result: Result) -> list[tuple[str, Result]]:
        """Takes one result; gives what can now be read, in planned order (often nothing).

        Raises `ValueError` for a route that is not planned or has finished before.
        """
        self._enter(route, (result,))
        return self._release()

    def drop(self, route: str) -> list[tuple[str, Result]]:
        """The route will have no result (its simulator broke): it is left out at its place, not replaced."""
        self._enter(route, ())
        self._dropped.add(route)
        return self._release()

    @property
    def next_route(self) -> str | None:
        """The route that everything else waits for, None at the end."""
        return self._planned[self._read] if self._read < len(self._planned) else None

    @property
    def ahead(self) -> int:
        """How many results wait because a route before them has not finished: unused if the verdict comes first."""
        return sum(self._places[route] >= self._read and route not in self._dropped for route in self._finished)

    @property
    def dropped(self) -> tuple[str, ...]:
        """The routes that were dropped, in planned order."""
        return tuple(route for route in self._planned if route in self._dropped)

    @property
    def lost_too_many(self) -> bool:
        """True when more than 5 % of the planned routes were dropped: what is left may be another kind of routes."""
        return len(self._dropped) > _MOST_DROPPED * len(self._planned)

    @property
    def is_complete(self) -> bool:
        """True once every planned route was read or dropped."""
        return self._read == len(self._planned)

    def _enter(self, route: str, result: tuple[Result, ...]) -> None:
        if route not in self._places:
            raise ValueError(f"route {route!r} is not planned.")
        if route in self._finished:
            raise ValueError(f"route {route!r} finished before.")
        self._finished[route] = result

    def _release(self) -> list[tuple[str, Result]]:
        released = []
        while self._read < len(self._planned) and self._planned[self._read] in self._finished:
            route = self._planned[self._read]
            released += [(route, result) for result in self._finished[route]]
            self._read += 1
        return released
