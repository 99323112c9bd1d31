"""`tcp`: a compact re-implementation of TCP, "Trajectory-guided Control Prediction" (Wu et al., NeurIPS 2022).

Never the original: 1.3 M parameters in place of about 27 M, trained in the embedded world. Kept are the two branches
and what ties them, three front cameras joined in one picture, the measurements (speed, target point, command), the
target point as an input of the waypoint GRU, and the whole wrapper of Bench2Drive's `tcp_b2d_agent.py`: raw GPS, a
route planner that drops points by it, a PID on four waypoints that falls back to the target point, a throttle cap above
walking pace, the first tick coasting. That wrapper is why it creeps and why a speedometer that reads too low makes it
drive faster. `_nets.tcp` tells what of the network is not kept. Gains, target rule and caps are the published ones;
those of `tuning="ours"` were found for a plain car (`_wrappers.tuning`).

`mode="traj"`, the reference, drives by the trajectory branch alone, as the agent in the tables of Bench2Drive does;
`"ctrl"` by the control branch alone; `"fused"` by both, as the paper does.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.inference import Network
from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents._wrappers import tuning as numbers
from drive_robust_agents._wrappers.learned_agent import LearnedAgent, NetworkRow
from drive_robust_agents._wrappers.pid import Point, WaypointController, WaypointTuning, capped_throttle
from drive_robust_agents._wrappers.sensed_pose import SensedPose
from drive_robust_agents._wrappers.tuning import Tuning
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath, rig
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.jit.arrays import Pixels

__all__ = ["CAMERAS", "TCP", "Fusion", "Mode", "joined"]

Mode = Literal["traj", "ctrl", "fused"]


CAMERAS = rig("tcp", width_px=160, height_px=96)
"""The three front cameras of the published agent, left to right, at a tenth of its resolution."""


def joined(pictures: Sequence[Pixels]) -> Pixels:
    """Return one picture (..., 96, 384, 3) of the pictures of the three cameras, (..., 96, 160, 3) each, left to right.

    Neighbouring cameras overlap at their edges, so a tenth of the width is cut from either side of each picture.
    (Published: an eighth, which would leave a width that the strides of the network do not divide.) Source:
    Bench2DriveZoo `team_code/tcp_b2d_agent.py`, `tick`.
    """
    width = pictures[0].shape[-2]
    edge = width // 10
    return np.concatenate([picture[..., edge : width - edge, :] for picture in pictures], axis=-2)


_JOINED = joined([np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8) for camera in CAMERAS])


class Fusion:
    """Mixes two branches: the control branch leads while the vehicle is turning, else the trajectory branch.

    Published: the vehicle is turning when more than 10 of the last 20 steerings were beyond 0.1; the leading branch has
    a weight of 0.7.
    """

    LEADS, OF_LAST, TURNS_FROM, MORE_THAN = 0.7, 20, 0.1, 10

    def __init__(self) -> None:
        self._steered: deque[bool] = deque(maxlen=self.OF_LAST)

    def merge(self, trajectory: Control, control: Control) -> Control:
        """Return the weighted mean of both branches' controls."""
        turning = sum(self._steered) > self.MORE_THAN
        lead, other = (control, trajectory) if turning else (trajectory, control)
        a, b = self.LEADS, 1.0 - self.LEADS
        return Control(
            throttle=a * lead.throttle + b * other.throttle,
            steer=a * lead.steer + b * other.steer,
            brake=a * lead.brake + b * other.brake,
        )

    def applied(self, steer: float) -> None:
        """Remember the steering that was given to the car."""
        self._steered.append(abs(steer) > self.TURNS_FROM)


class TCP(LearnedAgent):
    """Three front cameras, raw GPS, compass and speed in; four waypoints, an action, a control out.

    The options after `mode` are those of `LearnedAgent`. Raises `UnknownNameError` for another mode.
    """

    consumes = frozenset({"cameras", "gps", "compass", "speed"})
    name = "tcp"
    network_class = "tcp:TcpNet"
    weights = (SHIPPED / "tcp.safetensors", SHIPPED / "tcp.onnx")
    pictures: ClassVar[Mapping[str, Any]] = {"height_px": _JOINED.shape[0], "width_px": _JOINED.shape[1]}
    tunings: ClassVar[Mapping[Tuning, WaypointTuning]] = {"ours": numbers.TCP, "published": numbers.TCP_PUBLISHED}

    def __init__(
        self,
        mode: Mode = "traj",
        *,
        tuning: Tuning = "published",
        engine: str = "onnx",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
        network: Network | None = None,
    ) -> None:
        _require_mode(mode)
        self.mode: Mode = mode
        super().__init__(
            tuning=tuning, engine=engine, device=device, dtype=dtype, threads=threads,
            weights=weights, network=network,
        )  # fmt: skip

    @classmethod
    def check(cls, **options: Any) -> None:
        """Raise `UsageError` for an unknown mode and for the options that `LearnedAgent.check` refuses."""
        _require_mode(options.get("mode", "traj"))
        super().check(**options)

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the three front cameras."""
        return CAMERAS

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        super().reset(route, seed)
        self._controller, self._fusion = WaypointController(self.tunings[self.tuning]), Fusion()
        self._coasts = True

    def _prepare(self, observation: Observation) -> NetworkRow:
        pose = SensedPose.of(observation)
        target = self._target(pose.x_m, pose.y_m)
        aim, _ = target.seen_from(*pose)
        inputs: dict[str, NDArray[Any]] = {
            "image": joined([observation.cameras[camera.name].pixels for camera in CAMERAS]),
            "speed": np.array(observation.speed.mps, dtype=np.float32),
            "target": np.array(aim, dtype=np.float32),
            "command": np.array(int(target.command), dtype=np.int64),
        }
        return NetworkRow(inputs, (aim,))

    def _control(
        self, observation: Observation, targets: tuple[Point, ...], outputs: Mapping[str, NDArray[Any]]
    ) -> Control:
        """Return the control of the mode's branch; coast in the first tick of an episode."""
        waypoints = tuple((x, y) for x, y in outputs["waypoints"].tolist())
        self._planned = PlannedPath(path=waypoints, target_points=targets, speed_points=waypoints)
        if self._coasts:
            self._coasts = False
            return Control()
        speed_mps = observation.speed.mps
        control = self._for_driven_car(self._controller.step(waypoints, speed_mps, targets[0]), speed_mps)
        if self.mode != "traj":
            direct = _direct(outputs["action"].tolist())  # learned from this car's controls, so needs no conversion
            control = direct if self.mode == "ctrl" else self._fusion.merge(control, direct)
            if self._controller.tuning.full_brake and control.brake > 0.0:
                control = Control(control.throttle, control.steer, 1.0)
            cap = Control(throttle=capped_throttle(self._controller.tuning, speed_mps, control.steer))
            most = 0.0 if control.brake > 0.5 else self._for_driven_car(cap, speed_mps).throttle
            control = Control(min(control.throttle, most), control.steer, control.brake)
        self._fusion.applied(control.steer)
        return control


def _require_mode(name: str) -> None:
    if name not in get_args(Mode):
        raise UnknownNameError.of("mode of tcp", name, get_args(Mode), hint="As in 'tcp:mode=fused'.")


def _direct(action: Sequence[float]) -> Control:
    """Return the control of (steering, acceleration), -1..1 each."""
    steer, acceleration = (min(max(value, -1.0), 1.0) for value in action)
    return Control(throttle=max(acceleration, 0.0), steer=steer, brake=max(-acceleration, 0.0))
