"""highway-env's `Road.act` and `Road.step` against our kernels with the same semantics.

Both step the same traffic, in rounds that alternate; every round starts from the same state, so that both do the same
work. Says also how far apart they end (nothing, where `CompatRoad.exact`), and how much happened meanwhile.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from highway_env.envs import HighwayEnv, IntersectionEnv, MergeEnv, RoundaboutEnv
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from rich.console import Console
from rich.table import Table

from pytest_drive_robust.simulators.compat import CompatRoad

DT_S = 0.05
SMALLEST = {"vehicles_count": 1, "initial_vehicle_count": 1, "simulation_frequency": 2, "policy_frequency": 1}
# name: environment, whether neighbours are searched on connected lanes
CASES: dict[str, tuple[type[AbstractEnv], bool]] = {
    "highway": (HighwayEnv, False),
    "merge": (MergeEnv, True),
    "roundabout": (RoundaboutEnv, True),
    "intersection": (IntersectionEnv, False),
    "intersection, connected lanes": (IntersectionEnv, True),
}


def network_of(environment: type[AbstractEnv]) -> RoadNetwork:
    before = {name: value for name, value in vars(IDMVehicle).items() if name.isupper()}
    network = environment(config=SMALLEST).road.network
    for name, value in before.items():
        setattr(IDMVehicle, name, value)  # IntersectionEnv leaves others there
    return network


def crowded(network: RoadNetwork, *, connected: bool, count: int, seed: int) -> Road:
    """`count` IDM vehicles at random places, at least 7 m apart."""
    road = Road(network, np_random=np.random.RandomState(0), neighbour_vehicles_connected_lanes=connected)
    draw = np.random.Generator(np.random.Philox(seed))
    lanes = network.lanes_list()
    while len(road.vehicles) < count:
        lane = lanes[int(draw.integers(len(lanes)))]
        s = draw.uniform(0.0, min(lane.length, 200.0))
        position = lane.position(s, 0.0)
        if all(np.linalg.norm(other.position - position) > 7.0 for other in road.vehicles):
            speed = draw.uniform(0.4, 1.1) * lane.speed_limit
            road.vehicles.append(IDMVehicle(road, position, lane.heading_at(s), speed))
    return road


def seconds(work: Callable[[], object], ticks: int) -> float:
    start = time.process_time()
    for _ in range(ticks):
        work()
    return time.process_time() - start


def count_changes(compat: CompatRoad, ticks: int) -> int:
    """How often a vehicle came to another lane of the road on which it was."""
    changes, before = 0, compat.lane_indices
    for _ in range(ticks):
        compat.step(DT_S)
        now = compat.lane_indices
        changes += sum(a[:2] == b[:2] and a != b for a, b in zip(before, now, strict=True))
        before = now
    return changes


@dataclass(frozen=True)
class Round:
    theirs_s: float
    ours_s: float
    apart_m: float
    crashed: int
    changes: int


def drive(network: RoadNetwork, *, connected: bool, vehicles: int, ticks: int, seed: int) -> Round:
    road, twin = (crowded(network, connected=connected, count=vehicles, seed=seed) for _ in range(2))
    compat = CompatRoad.from_road(twin)
    start = compat.snapshot()
    compat.step(DT_S)  # compile
    compat.restore(start)

    def tick() -> None:
        road.act()
        road.step(DT_S)

    theirs_s, ours_s = seconds(tick, ticks), seconds(lambda: compat.step(DT_S), ticks)
    apart_m = float(np.abs(np.array([vehicle.position for vehicle in road.vehicles]) - compat.positions_m).max())
    crashed = int(compat.crashed.sum())
    compat.restore(start)
    return Round(theirs_s, ours_s, apart_m, crashed, count_changes(compat, ticks))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--ticks", type=int, default=200)
    parser.add_argument("--vehicles", type=int, default=20)
    given = parser.parse_args()
    title = f"{given.vehicles} vehicles, {given.rounds} x {given.ticks} ticks, CPU time"
    table = Table("", "highway-env ticks/s", "ours", "×", "largest difference", "crashed", "lane changes", title=title)
    for name, (environment, connected) in CASES.items():
        network = network_of(environment)
        rounds = [
            drive(network, connected=connected, vehicles=given.vehicles, ticks=given.ticks, seed=seed)
            for seed in range(given.rounds)
        ]
        table.add_row(
            name,
            f"{given.ticks / statistics.median(r.theirs_s for r in rounds):,.0f}",
            f"{given.ticks / statistics.median(r.ours_s for r in rounds):,.0f}",
            f"{statistics.median(r.theirs_s / r.ours_s for r in rounds):.0f}",
            f"{max(r.apart_m for r in rounds):g} m",
            str(sum(r.crashed for r in rounds)),
            str(sum(r.changes for r in rounds)),
        )
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
