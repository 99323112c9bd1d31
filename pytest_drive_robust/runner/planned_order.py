"""The order in which routes are read, fixed before any of them is driven."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence


def planned_order(route_ids: Sequence[str], scenario_types: Sequence[str], seed_text: str) -> tuple[str, ...]:
    """Return the routes shuffled by `seed_text`, with the scenario types spread evenly over the whole order.

    A verdict may stop early only on a prefix of an order that is fixed in advance. A verdict on the episodes that
    finished first would read the quick routes, and quick routes are those that went well.

    With equally many routes of each type the order consists of blocks with one route of each type, shuffled within and
    between blocks. Otherwise a type with twice the routes comes twice as often from start to end. The order is the same
    on every machine and for any order of the arguments; only another `seed_text` changes it. Raises `ValueError` when a
    route has no type or comes twice.
    """
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
    """Return a number in 0..1 that depends only on `texts`: the same in every process, unlike `hash()`."""
    digest = hashlib.sha256("\x00".join(texts).encode("utf-8", "surrogatepass")).digest()
    return int.from_bytes(digest[:6], "big") / 2.0**48
