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

    `live`: vehicles, then objects, one for each row. `routes`: the live route lists, one for each row of
    `route_spans`; vehicles that share a list share the row.
    """

    arrays: Arrays
    live: tuple[Any, ...]
    routes: tuple[list[Any], ...]

    @classmethod
    def of_road(cls, road: Any, network: Network) -> Reading:
        """Read all vehicles and objects. Raises `SimulationError` for a class that the kernels do not know."""
        vehicles, objects = tuple(road.vehicles), tuple(road.objects)
        live = vehicles + objects
        kinds = [vehicle_kind(vehicle) for vehicle in vehicles] + [object_kind(thing) for thing in objects]
        routes = {id(route): route for route in (getattr(vehicle, "route", None) for vehicle in vehicles) if route}
        arrays = _empty_arrays(road, network, bodies=len(live), vehicles=len(vehicles), routes=tuple(routes.values()))
        numbers = {key: number for number, key in enumerate(routes)}
        speeds: list[float] = []
        for row, (body, kind) in enumerate(zip(live, kinds, strict=True)):
            floats, ints = arrays.bodies[row], arrays.body_ints[row]
            read_parameters(body, kind, arrays.parameters[row])
            read_body(body, kind, network, floats=floats, ints=ints)
            ints[c.I_ROUTE] = numbers.get(id(getattr(body, "route", None)), -1)
            if kind == c.MDP:
                ints[[c.I_FIRST_SPEED, c.I_SPEEDS]] = len(speeds), len(body.target_speeds)
                speeds += [float(speed) for speed in body.target_speeds]
        arrays = arrays._replace(target_speeds=np.array(speeds, dtype=np.float64))
        settle(arrays)
        return cls(arrays, live, tuple(routes.values()))

    def write(self, network: Network, *, keep_history: bool) -> None:
        """Write the arrays into the live things; `keep_history`: append the pose to the vehicles' trails too."""
        for row, body in enumerate(self.live):
            write_body(body, network, floats=self.arrays.bodies[row], ints=self.arrays.body_ints[row])
            if keep_history and row < self.arrays.vehicle_count:
                body.history.appendleft(body.create_from(body))
        for route, (first, end) in zip(self.routes, self.arrays.route_spans, strict=True):
            del route[: len(route) - int(end - first)]


def _empty_arrays(
    road: Any, network: Network, *, bodies: int, vehicles: int, routes: tuple[list[Any], ...]
) -> Arrays:  # fmt: skip
    lanes, search = len(network.lanes), 2 * len(network.edges) + 1
    steps, spans = _route_arrays(network, routes)
    return Arrays(
        machine=machine(),
        connected=int(getattr(road, "neighbour_vehicles_connected_lanes", False)),
        lanes=network.lane_floats,
        lane_ints=network.lane_ints,
        edges=network.edges,
        nodes=network.nodes,
        entering=network.entering,
        vehicle_count=vehicles,
        bodies=np.zeros((bodies, c.BODY_FLOATS)),
        body_ints=np.zeros((bodies, c.BODY_INTS), dtype=np.int64),
        parameters=np.zeros((bodies, c.BODY_PARAMETERS)),
        route_steps=steps,
        route_spans=spans,
        target_speeds=np.zeros(0),
        along=np.zeros((lanes, bodies)),
        across=np.zeros((lanes, bodies)),
        search_lanes=np.zeros(search, dtype=np.int64),
        search_offsets=np.zeros(search),
    )


def _route_arrays(network: Network, routes: tuple[list[Any], ...]) -> tuple[c.Ints, c.Ints]:
    """(steps, 2) and (routes, 2) as in `columns`."""
    steps: list[tuple[int, int]] = []
    spans: list[tuple[int, int]] = []
    for route in routes:
        first = len(steps)
        steps += [_route_step(network, index) for index in route]
        spans.append((first, len(steps)))
    return (
        np.array(steps, dtype=np.int64).reshape(-1, 2),
        np.array(spans, dtype=np.int64).reshape(-1, 2),
    )


def _route_step(network: Network, index: tuple[str, str, int | None]) -> tuple[int, int]:
    start, end, place = index
    edge = network.edge(start, end)
    if place is None:
        return edge, c.NO_ID
    if not 0 <= place < network.edges[edge, c.E_COUNT]:
        raise SimulationError(f"The route step {index!r} asks for an id from 0 to {network.edges[edge, c.E_COUNT] - 1}.")
    return edge, int(place)
