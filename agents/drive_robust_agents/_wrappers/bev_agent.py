"""The base of the two agents with six cameras: network inputs, and driving by waypoints.

The agents follow the wrappers of Bench2DriveZoo (`team_code/uniad_b2d_agent.py`, `team_code/vad_b2d_agent.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._wrappers.learned_agent import LearnedAgent, NetworkRow
from drive_robust_agents._wrappers.memory import Memory, can_bus, motion_between
from drive_robust_agents._wrappers.pid import Point, WaypointController, WaypointTuning
from drive_robust_agents._wrappers.sensed_pose import SensedPose
from drive_robust_agents._wrappers.tuning import Tuning
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath, rig

__all__ = ["CAMERAS", "BevAgent"]

CAMERAS = rig("nuscenes", width_px=160, height_px=96)
"""Six cameras all around, in the order in which the networks take their pictures."""


class BevAgent(LearnedAgent):
    """An agent with six pictures, a command and a can bus as inputs and waypoints as output, and an episode's memory.

    A subclass gives the numbers of its controller, `tunings`, and names in `remembers` the outputs of its network that
    are inputs again 0.5 s later. The network is run with

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

    and returns at least `waypoints` (N, 6, 2), metres in the ego frame 0.5 s apart, and `<name>` of each memory.
    """

    consumes = frozenset({"cameras", "gps", "compass", "imu", "speed"})
    pictures: ClassVar[Mapping[str, Any]] = {
        "bev": {
            "cameras": [camera.name for camera in CAMERAS],
            "image_height_px": CAMERAS[0].height_px,
            "image_width_px": CAMERAS[0].width_px,
        }
    }
    tunings: ClassVar[Mapping[Tuning, WaypointTuning]]
    remembers: ClassVar[Mapping[str, tuple[int, ...]]]

    def sensors(self) -> Sequence[CameraSpec]:
        """Return six cameras all around."""
        return CAMERAS

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        super().reset(route, seed)
        self._controller, self._memory = WaypointController(self.tunings[self.tuning]), Memory(self.remembers)

    def _waypoints(self, outputs: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        """Return the plan (6, 2) from the outputs of one row; override to change the network's plan."""
        return outputs["waypoints"]

    def _prepare(self, observation: Observation) -> NetworkRow:
        pose, imu = SensedPose.of(observation), observation.imu
        target = self._target(pose.x_m, pose.y_m)
        then, old = self._memory.recall(observation.tick)
        motion = motion_between(np.array([pose if then is None else then]), np.array([pose]))
        measured = np.array([[imu.forward_mps2, imu.right_mps2, imu.yaw_rate_radps]], dtype=np.float32)
        inputs: dict[str, NDArray[Any]] = {
            "images": np.stack([observation.cameras[camera.name].pixels for camera in CAMERAS]),
            "can_bus": can_bus(np.array([observation.speed.mps], dtype=np.float32), measured, motion)[0],
            "command": np.array(int(target.command), dtype=np.int64),
            "motion": motion[0],
            "known": np.array(then is not None, dtype=np.float32),
        }
        aim, _ = target.seen_from(*pose)
        return NetworkRow(inputs | {f"old_{name}": values for name, values in old.items()}, (aim,))

    def _control(
        self, observation: Observation, targets: tuple[Point, ...], outputs: Mapping[str, NDArray[Any]]
    ) -> Control:
        self._memory.keep(observation.tick, SensedPose.of(observation), outputs)
        way = tuple((x, y) for x, y in self._waypoints(outputs).tolist())
        self._planned = PlannedPath(path=way, target_points=targets, speed_points=way)
        control = self._controller.step(way, observation.speed.mps, targets[0])
        brake = 0.0 if control.throttle > control.brake else control.brake
        return self._for_driven_car(Control(control.throttle, control.steer, brake), observation.speed.mps)
