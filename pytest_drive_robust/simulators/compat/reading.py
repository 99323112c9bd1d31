"""Everything on a live road as one set of arrays, and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.advance import settle
from pytest_drive_robust.simulators.compat.arithmetic import machine
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.known import object_kind, vehicle_kind
from pytest_drive_robust.simulators.compat.network import Network
from pytest_drive_robust.simulators.compat.vehicles import read_body, read_parameters, write_body

__all__ = ["Reading"]


@dataclass(frozen=True, slots=True)
class Reading:
    """The arrays of a road and the live things they were read from.

    `live`: vehicles (`vehicle_count` of them), then objects, one for each row. `live_routes`: the live route lists, one
    for each of the first rows of `routes`; vehicles that share a list share the row.
    """

    arrays: Arrays
    vehicle_count: int
    live: tuple[Any, ...]
    live_routes: tuple[list[Any], ...]

    @classmethod
    def of_road(cls, road: Any, network: Network) -> Reading:
        """Read all vehicles and objects. Raises `SimulationError` for a class that the kernels do not know."""
        vehicles, objects = tuple(road.vehicles), tuple(road.objects)
        live = vehicles + objects
        kinds = [vehicle_kind(vehicle) for vehicle in vehicles] + [object_kind(thing) for thing in objects]
        routes = {id(route): route for route in (getattr(vehicle, "route", None) for vehicle in vehicles) if route}
        numbers = {key: number for number, key in enumerate(routes)}
        arrays = Arrays(
            machine=machine(),
            lanes=network.lane_floats,
            lane_ints=network.lane_ints,
            edges=network.edges,
            search=network.search,
            bodies=np.zeros((len(live), c.BODY_FLOATS)),
            body_ints=np.zeros((len(live), c.BODY_INTS), dtype=np.int64),
            routes=_route_rows(network, tuple(routes.values())),
            coordinates=np.zeros((2, len(network.lanes), len(live))),
        )
        for body, kind, floats, ints in zip(live, kinds, arrays.bodies, arrays.body_ints, strict=True):
            read_parameters(body, kind, floats)
            read_body(body, kind, network, floats=floats, ints=ints)
            ints[c.I_ROUTE] = numbers.get(id(getattr(body, "route", None)), -1)
        settle(arrays)
        return cls(arrays, len(vehicles), live, tuple(routes.values()))

    def write(self, network: Network, *, keep_history: bool) -> None:
        """Write the arrays into the live things; `keep_history`: append the pose to the vehicles' trails too."""
        for row, body in enumerate(self.live):
            write_body(body, network, floats=self.arrays.bodies[row], ints=self.arrays.body_ints[row])
            if keep_history and row < self.vehicle_count:
                body.history.appendleft(body.create_from(body))
        for route, (first, end) in zip(self.live_routes, self.arrays.routes, strict=False):
            del route[: len(route) - int(end - first)]


def _route_rows(network: Network, routes: tuple[list[Any], ...]) -> c.Ints:
    """(routes + steps, 2) as in `columns`."""
    spans: list[tuple[int, int]] = []
    steps: list[tuple[int, int]] = []
    for route in routes:
        first = len(routes) + len(steps)
        spans.append((first, first + len(route)))
        steps += [_route_step(network, index) for index in route]
    return np.array(spans + steps, dtype=np.int64).reshape(-1, 2)


def _route_step(network: Network, index: tuple[str, str, int | None]) -> tuple[int, int]:
    start, end, place = index
    edge = network.edge(start, end)
    if place is None:
        return edge, c.NO_ID
    if not 0 <= place < network.edges[edge, c.E_COUNT]:
        raise SimulationError(
            f"The route step {index!r} asks for an id from 0 to {network.edges[edge, c.E_COUNT] - 1}."
        )
    return edge, int(place)
