"""Find the lanes that the ego of an environment is to drive: to its destination, to its exit, or straight on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from highway_env.envs.exit_env import ExitEnv
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.road.road import RoadNetwork

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.gymnasium.road_map import DEFAULT_LIMIT_MPS, LaneKey

_ARRIVAL_M = 24.0  # `IntersectionEnv.has_arrived`: 25 m into any exit
_MERGE_END_X_M = 370.0  # `MergeEnv._is_terminated`
_GOALLESS_S = 40.0
_GOALLESS_SHARE = 0.5
_LONGEST_M = 1500.0
_JOIN_M, _JOIN_COS = 6.0, 0.5


@dataclass(frozen=True)
class Itinerary:
    """Lanes in driving order; the route ends `end_m` along the last lane.

    A step from one lane to another lane of the same road (equal nodes) is a lane change.
    """

    lanes: tuple[LaneKey, ...]
    end_m: float


def itinerary_of(env: Any) -> Itinerary:
    """Return the lanes for the ego of a freshly reset `env` (unwrapped).

    The ego drives to the destination that the environment planned, or to its exit. Without a destination, the ego
    drives straight on along the lanes: to the end of the road, once around a closed track, or half as far as the speed
    limit allows in the environment's own duration (40 s without a duration). Raises `SimulationError` when the
    destination cannot be reached.
    """
    network, start = env.road.network, env.vehicle.lane_index
    if isinstance(env, ExitEnv):
        return _to_the_exit(env, start)
    destination = getattr(env.vehicle, "destination_node", None)
    if destination is not None and destination != start[1]:
        lanes = _through(network, start, destination)
        length = network.get_lane(lanes[-1]).length
        return Itinerary(lanes, min(length, _ARRIVAL_M) if isinstance(env, IntersectionEnv) else length)
    if isinstance(env, MergeEnv):
        lanes = _straight_on(network, start, _LONGEST_M)
        end_x_m = getattr(env, "end_position", 0) or _MERGE_END_X_M
        return Itinerary(lanes, float(network.get_lane(lanes[-1]).local_coordinates([end_x_m, 0.0])[0]))
    limit = float(env.vehicle.lane.speed_limit or DEFAULT_LIMIT_MPS)
    config = env.default_config() if hasattr(env, "default_config") else env.config  # the duration of ours is lifted
    length = min(_GOALLESS_SHARE * limit * float(config.get("duration") or _GOALLESS_S), _LONGEST_M)
    return _bounded(network, env, _straight_on(network, start, length), length)


def _through(network: RoadNetwork, start: LaneKey, destination: str) -> tuple[LaneKey, ...]:
    """Return the lanes of the shortest way by nodes, which highway-env plans for its own vehicles."""
    nodes = network.shortest_path(start[1], destination)
    if not nodes:
        raise SimulationError(f"the environment sends its ego from {start} to node {destination!r}: there is no way.")
    lanes = [start]
    for node, after in pairwise(nodes):
        lanes.append((node, after, _number_on(network, lanes[-1], after)))
    return tuple(lanes)


def _straight_on(network: RoadNetwork, start: LaneKey, length_m: float) -> tuple[LaneKey, ...]:
    """Return the lanes that follow most smoothly, over at least `length_m`, up to a dead end or back to `start`."""
    lanes, total = [start], 0.0  # the ego may stand at the end of its first lane, which counts for nothing
    while True:
        key = lanes[-1]
        onward = [(key[1], node, _number_on(network, key, node)) for node in network.graph.get(key[1], {})]
        joined = [(turn, after) for after in onward if (turn := _turn(network, key, after)) is not None]
        if total >= length_m or not joined:
            return tuple(lanes)
        lanes.append(min(joined)[1])
        total += float(network.get_lane(lanes[-1]).length)
        if lanes[-1][:2] == start[:2]:
            return tuple(lanes)


def _bounded(network: RoadNetwork, env: Any, lanes: tuple[LaneKey, ...], length_m: float) -> Itinerary:
    """Return the first `length_m` metres of `lanes` from the ego on, or one round of a closed track."""
    left = length_m + float(network.get_lane(lanes[0]).local_coordinates(env.vehicle.position)[0])
    around = len(lanes) > 1 and lanes[-1][:2] == lanes[0][:2]
    for k, key in enumerate(lanes):
        length = float(network.get_lane(key).length)
        if left <= length:
            return Itinerary(lanes[: k + 1], left)
        if k < len(lanes) - 1:
            left -= length
    if around:  # stop short of the start: the line must not cross itself
        return Itinerary(lanes[:-1], float(network.get_lane(lanes[-2]).length))
    return Itinerary(lanes, float(network.get_lane(lanes[-1]).length))


def _number_on(network: RoadNetwork, key: LaneKey, node: Any) -> int:
    """Return the number of the lane from `key` towards `node`: the same number if the roads match, else the nearest."""
    lane = network.get_lane(key)
    end = lane.position(lane.length, 0.0)
    return int(network.next_lane_given_next_road(*key, node, None, end)[0])


def _turn(network: RoadNetwork, key: LaneKey, after: LaneKey) -> float | None:
    """Return the turn from the end of `key` to the end of `after` [rad], or None when the lanes do not join."""
    lane, other = network.get_lane(key), network.get_lane(after)
    gap = math.hypot(*(other.position(0.0, 0.0) - lane.position(lane.length, 0.0)))
    heading = float(lane.heading_at(lane.length))
    if gap > _JOIN_M or math.cos(float(other.heading_at(0.0)) - heading) < _JOIN_COS:
        return None
    turn = float(other.heading_at(other.length)) - heading
    return abs(math.remainder(turn, 2.0 * math.pi))


def _to_the_exit(env: ExitEnv, start: LaneKey) -> Itinerary:
    """Return the lanes over the outermost lane to the exit; `ExitEnv` demands this way but does not plan it."""
    last = int(env.config["lanes_count"])
    changes = tuple((start[0], start[1], number) for number in range(int(start[2]), last))
    exit_lane = ("2", "exit", 0)
    lanes = (*changes, ("1", "2", last - 1), ("1", "2", last), exit_lane)
    return Itinerary(lanes, float(env.road.network.get_lane(exit_lane).length))
