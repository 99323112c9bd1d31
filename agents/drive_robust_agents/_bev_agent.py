"""What the two agents that look around with six cameras have in common: their inputs and their memory of 0.5 s ago.

The published wrappers (Bench2DriveZoo `team_code/uniad_b2d_agent.py`, `team_code/vad_b2d_agent.py`) fill an 18-number
"can bus" from GPS, compass, speedometer and IMU, and the bird's-eye features of the last frame are shifted by it, so
that a wrong position moves the memory against the picture. Here the can bus has six numbers, and the memory is the one
of 0.5 s ago, in training as at run time (the published ones are trained at 0.5 s and driven at 0.05 s).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._wrappers.pid import WaypointController, WaypointTuning
from drive_robust_agents._wrappers.route_planner import RoutePlanner, Target
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.rigs import rig

__all__ = ["CAMERAS", "CAN_BUS", "LAG_TICKS", "BevAgent", "Memory", "Network", "Sensed", "can_bus", "motion_between"]

Floats = NDArray[np.float32]

CAMERAS = rig("nuscenes", width_px=160, height_px=96)
"""Six cameras all around, in the order in which the networks take their pictures."""

LAG_TICKS = 10
"""How old the memory is: 0.5 s."""

CAN_BUS = ("speed", "yaw rate", "forward acceleration", "right acceleration", "forward movement", "movement right")
"""m/s, rad/s, m/s2, m/s2, and the metres moved since the memory, in the ego frame of then (0 without a memory)."""


def motion_between(old: NDArray[np.float64], now: NDArray[np.float64]) -> Floats:
    """Where the ego is now, seen from where it was: (n, 3) forward m, right m, yaw rad of two (n, 3) arrays of poses.

    A point (x, y) in the frame of now lies at R(yaw) (x, y) + (forward, right) in the frame of then.
    """
    dx, dy = (now[:, :2] - old[:, :2]).T
    c, s = np.cos(old[:, 2]), np.sin(old[:, 2])
    turned = np.remainder(now[:, 2] - old[:, 2] + math.pi, math.tau) - math.pi
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, turned]).astype(np.float32)


def can_bus(speed: Floats, imu: Floats, motion: Floats) -> Floats:
    """(n, 6) as `CAN_BUS` from speed (n,), IMU (n, 3: forward, right, yaw rate) and `motion_between` (n, 3)."""
    return np.column_stack([speed, imu[:, 2], imu[:, 0], imu[:, 1], motion[:, 0], motion[:, 1]]).astype(np.float32)


class Sensed(NamedTuple):
    """The pose that GPS and compass measured: metres and rad in the route's frame; a compass that says NaN is 0."""

    x_m: float
    y_m: float
    yaw_rad: float

    @staticmethod
    def of(observation: Observation) -> Sensed:
        """Of one tick, unfiltered, as the published wrappers take it."""
        yaw = observation.compass.yaw_rad
        return Sensed(observation.gps.x_m, observation.gps.y_m, 0.0 if math.isnan(yaw) else yaw)


class Memory:
    """A ring buffer of what a network gave in each tick, with the pose that was sensed then.

    `shapes` names what is remembered: arrays of one episode, without a batch axis.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._nothing = {name: np.zeros(shape, dtype=np.float32) for name, shape in shapes.items()}
        self._kept: deque[tuple[int, Sensed, Mapping[str, Floats]]] = deque()

    def recall(self, tick: int) -> tuple[Sensed | None, Mapping[str, Floats]]:
        """The youngest memory that is 0.5 s old, with its pose; None and zeros when there is none, or only older ones.

        Where ticks are left out, one of up to 1 s is taken.
        """
        while len(self._kept) > 1 and tick - self._kept[1][0] >= LAG_TICKS:
            self._kept.popleft()
        if self._kept and LAG_TICKS <= tick - self._kept[0][0] <= 2 * LAG_TICKS:
            _, pose, features = self._kept[0]
            return pose, features
        return None, self._nothing

    def keep(self, tick: int, pose: Sensed, outputs: Mapping[str, Floats]) -> None:
        """Remember this tick; a tick that is not later than the last one starts a new memory."""
        if self._kept and tick <= self._kept[-1][0]:
            self._kept.clear()
        self._kept.append((tick, pose, {name: outputs[name].copy() for name in self._nothing}))


class Network(Protocol):
    """What the agents need of `_nets.inference.Policy`."""

    def run(self, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        """All rows at once: arrays with the batch axis first."""
        ...


class BevAgent:
    """Six pictures, a command and a can bus in, waypoints out; what an episode remembers is in here.

    A subclass says in `remembers` which outputs of its network come back 0.5 s later. The network is run with

    ============ ================== ============================================================
    name         shape and type     meaning
    ============ ================== ============================================================
    images       (N, 6, H, W, 3) u8 RGB in the order of `CAMERAS`
    can_bus      (N, 6) f32         `CAN_BUS`
    command      (N,) i64           the planner's `RoadOption`, 1..6
    motion       (N, 3) f32         `motion_between`: the ego now, seen from the memory; else 0
    known        (N,) f32           1 where there is a memory, else 0 and zeros in the next ones
    old_<name>   (N, *shape) f32    what the network gave as <name> 0.5 s ago
    ============ ================== ============================================================

    and gives at least `waypoints` (N, 6, 2), metres in the ego frame 0.5 s apart, and `<name>` of each memory.
    """

    consumes: frozenset[str] = frozenset({"cameras", "gps", "compass", "imu", "speed"})
    remembers: ClassVar[Mapping[str, tuple[int, ...]]]

    def __init__(self, network: Network, tuning: WaypointTuning) -> None:
        self._network, self._tuning = network, tuning
        self.reset(GlobalPlan(()), 0)

    def sensors(self) -> Sequence[CameraSpec]:
        """Six cameras all around."""
        return CAMERAS

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        self._planner = RoutePlanner(route) if route.points else None
        self._controller = WaypointController(self._tuning)
        self._memory = Memory(self.remembers)
        self._planned = PlannedPath()

    def act(self, observation: Observation) -> Control:
        """Look, plan, steer."""
        return self.act_batch([self], [observation])[0]

    @classmethod
    def act_batch(cls, agents: Sequence[BevAgent], observations: Sequence[Observation]) -> Sequence[Control]:
        """`act` for agents that share a network, in one run of it."""
        seen = [agent._look(observation) for agent, observation in zip(agents, observations, strict=True)]
        inputs = {name: np.stack([one[name] for one, _ in seen]) for name in seen[0][0]}
        outputs = agents[0]._network.run(**inputs)
        rows = [{name: values[row] for name, values in outputs.items()} for row in range(len(agents))]
        return [
            agent._follow(observation, target, row)
            for agent, observation, (_, target), row in zip(agents, observations, seen, rows, strict=True)
        ]

    def plan(self) -> PlannedPath:
        """The waypoints and the target point behind the last control."""
        return self._planned

    def waypoints(self, outputs: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        """(6, 2) from the outputs of one row; for agents that change the plan after the network."""
        return outputs["waypoints"]

    def _look(self, observation: Observation) -> tuple[dict[str, NDArray[Any]], Target]:
        """One row of the network's inputs, and where the route goes on."""
        if self._planner is None:
            raise ValueError("the agent has no route, expected reset(route, seed) with a plan before the first act")
        pose, imu = Sensed.of(observation), observation.imu
        target = self._planner.step(pose.x_m, pose.y_m)
        then, old = self._memory.recall(observation.tick)
        motion = motion_between(np.array([pose if then is None else then]), np.array([pose]))
        measured = np.array([[imu.forward_mps2, imu.right_mps2, imu.yaw_rate_radps]], dtype=np.float32)
        row: dict[str, NDArray[Any]] = {
            "images": np.stack([observation.cameras[camera.name].pixels for camera in CAMERAS]),
            "can_bus": can_bus(np.array([observation.speed.mps], dtype=np.float32), measured, motion)[0],
            "command": np.array(int(target.command), dtype=np.int64),
            "motion": motion[0],
            "known": np.array(then is not None, dtype=np.float32),
        }
        return row | {f"old_{name}": values for name, values in old.items()}, target

    def _follow(self, observation: Observation, target: Target, outputs: Mapping[str, NDArray[Any]]) -> Control:
        """Keep the memory, then turn the plan into a control."""
        pose = Sensed.of(observation)
        self._memory.keep(observation.tick, pose, outputs)
        way = tuple((float(x), float(y)) for x, y in self.waypoints(outputs))
        aim, _ = target.seen_from(*pose)
        self._planned = PlannedPath(path=way, target_points=(aim,), speed_points=way)
        pedals = self._controller.step(way, observation.speed.mps, aim)
        brake = 0.0 if pedals.throttle > pedals.brake else pedals.brake
        return Control(throttle=pedals.throttle, steer=pedals.steer, brake=brake)
