"""A running environment in terms of the domain: its ego and actors after each step, and whether it stopped."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
from highway_env.vehicle.objects import Landmark

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import ActorKind, ActorState, EgoState, LaneMap, WorldState
from pytest_drive_robust.simulators.gymnasium.ego import acceleration_and_steering, action_of

_HEIGHT_M = {ActorKind.CAR: 1.55, ActorKind.TRUCK: 3.2, ActorKind.BARRIER: 1.0, ActorKind.BICYCLE: 1.7}
_TRUCK_M, _BICYCLE_M = 7.0, 1.0
_BRAKING_MPS2 = -0.7
_NO_LIGHTS = np.zeros(0, dtype=np.int64)


class LiveRoad:
    """One episode of an environment that was just reset. `index` maps highway-env's keys to lanes of `lane_map`.

    `ended` tells whether the environment stopped. `speed_before_mps` is the ego's speed one tick ago, because an impact
    changes the speed within the tick in which it is found.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], lane_map: LaneMap, index: dict[Any, int], *, dt_s: float) -> None:
        self._env = env
        self._inner: Any = env.unwrapped
        self._lane_map = lane_map
        self._index = index
        self._dt_s = dt_s
        self._numbers: dict[int, tuple[int, Any]] = {}  # by id(); keeps the object, so that its id stays unique
        self.tick = 0
        self.ended = False
        self.speed_before_mps = float(self.ego.speed)
        self._accelerations = (0.0, 0.0, 0.0)

    @property
    def ego(self) -> Any:
        """The highway-env vehicle that the agent drives."""
        return self._inner.vehicle

    @property
    def network(self) -> Any:
        """The road network."""
        return self._inner.road.network

    def step(self, control: Control) -> None:
        """Advance the environment by one step, 50 ms."""
        ego = self.ego
        before, heading = float(ego.speed), float(ego.heading)
        wanted = acceleration_and_steering(control, speed_mps=before, length_m=float(ego.LENGTH), dt_s=self._dt_s)
        _, _, terminated, truncated, _ = self._env.step(action_of(*wanted, self._inner.action_type))
        ego = self.ego
        if ego.speed < 0.0:  # from rounding at rest, or from a crash that throws the car back
            ego.speed = 0.0
        yaw_rate = math.remainder(float(ego.heading) - heading, 2.0 * math.pi) / self._dt_s
        self._accelerations = ((float(ego.speed) - before) / self._dt_s, float(ego.speed) * yaw_rate, yaw_rate)
        self.speed_before_mps = before
        self.ended = bool(terminated or truncated)
        self.tick += 1

    def state(self) -> WorldState:
        """Return the dynamic world of this moment; its arrays belong to the caller."""
        body = self.ego
        forward, right, yaw_rate = self._accelerations
        ego = EgoState(
            x_m=float(body.position[0]),
            y_m=float(body.position[1]),
            yaw_rad=math.remainder(float(body.heading), 2.0 * math.pi),
            speed_mps=float(body.speed),
            forward_mps2=forward,
            right_mps2=right,
            yaw_rate_radps=yaw_rate,
            length_m=float(body.LENGTH),
            width_m=float(body.WIDTH),
        )
        rows = [self._row(other) for other in self.others()]
        return WorldState(self.tick, ego, np.array(rows, dtype=np.float64).reshape(-1, WorldState.COLUMNS), _NO_LIGHTS)

    def others(self) -> list[Any]:
        """Return every vehicle and solid object but the ego."""
        road, ego = self._inner.road, self.ego
        solid = [thing for thing in road.objects if not isinstance(thing, Landmark)]
        return [vehicle for vehicle in road.vehicles if vehicle is not ego] + solid

    def whom_it_hit(self) -> Any | None:
        """Return the body that the crashed ego touches: the nearest other crashed body, or None."""
        ego = self.ego
        crashed = [other for other in self.others() if other.crashed]
        return min(
            crashed,
            key=lambda other: float(np.hypot(*(other.position - ego.position))) - other.diagonal / 2.0,
            default=None,
        )

    def _row(self, body: Any) -> list[float]:
        kind = kind_of(body)
        number, _ = self._numbers.setdefault(id(body), (len(self._numbers), body))
        x, y = body.position
        yaw = math.remainder(float(body.heading), 2.0 * math.pi)
        size = float(body.LENGTH), float(body.WIDTH), _HEIGHT_M[kind]
        return [number, kind, float(x), float(y), yaw, float(body.speed), *size, self._shown(body)]

    def _shown(self, body: Any) -> int:
        """Return `ActorState`: brake lights by its acceleration, indicators while it changes lanes."""
        action = getattr(body, "action", None) or {}
        state = ActorState.BRAKING if float(action.get("acceleration", 0.0)) < _BRAKING_MPS2 else ActorState.NONE
        lane, target = body.lane_index, getattr(body, "target_lane_index", None)
        if target is not None and target != lane and target[:2] == lane[:2] and lane in self._index:
            here, there = self._lane_map.lanes[self._index[lane]], self._index.get(target)
            if there == here.left:
                state |= ActorState.INDICATOR_LEFT
            elif there == here.right:
                state |= ActorState.INDICATOR_RIGHT
        return int(state)


def kind_of(body: Any) -> ActorKind:
    """Return the actor kind of a body of the road, by its class and size."""
    if not hasattr(body, "act"):
        return ActorKind.BARRIER
    if float(body.LENGTH) >= _TRUCK_M:
        return ActorKind.TRUCK
    return ActorKind.BICYCLE if float(body.WIDTH) <= _BICYCLE_M else ActorKind.CAR
