"""`simlingo`: a compact re-implementation of SimLingo, vision-only driving with language (Renz et al., CVPR 2025).

Never the original: 1.35 M parameters in place of about 900 M, trained in the embedded world from nothing. It has no
knowledge of language: 95 words, a grammar of prompts and instructions, and anything else is refused.

Kept: one causal transformer that reads the image, then a prompt (the speed as a token and as text, two target points
in place of placeholders), then its own answer word by word, then learned queries whose last hidden states are the plan:
20 path points one metre apart, which steer, and 10 waypoints 0.25 s apart, which drive. Commentary before acting;
instructions learnt from dreams, obeyed after `<follow>`, weighed after `<safety>`. The wrapper: a Kalman filter on GPS
(noise averages out), a route planner with 7.5 m, the raw speedometer, creeping after 40 s of standing, a brake in the
first tick. Its augmentation without missing blocks. As the published one, the wrapper counts calls and takes each for
0.05 s, be it asked in every tick or, under latency in the mode `hold`, only every few; `position_filter` changes that.

Not kept: InternVL2-1B and its pretraining (a residual net of 0.38 M and four layers of width 128 stand in its place),
tiles, LoRA, sampling up to 100 new tokens (at most 16, the likeliest), the unscented form of the filter. Unlike the
published agent it keeps keys and values; commentary costs time that depends on its length all the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.answer import GENERATE
from drive_robust_agents._nets.inference import Network
from drive_robust_agents._nets.prompts import (
    Instruction,
    by_targets,
    comment,
    driving,
    instructed,
    parse_instruction,
    prompt_row,
)
from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents._nets.words import CLOSING, decode
from drive_robust_agents._vehicle import mkz
from drive_robust_agents._wrappers import tuning as numbers
from drive_robust_agents._wrappers.kalman import PoseEstimate, PositionFilter, published_motion
from drive_robust_agents._wrappers.learned_agent import LearnedAgent, NetworkRow
from drive_robust_agents._wrappers.path_controller import Creep, PathController, PathTuning
from drive_robust_agents._wrappers.pid import Point
from drive_robust_agents._wrappers.route_planner import MIN_SIMLINGO_M
from drive_robust_agents._wrappers.sensed_pose import SensedPose
from drive_robust_agents._wrappers.tuning import Tuning
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath, rig
from pytest_drive_robust.errors import UnknownNameError, UsageError

__all__ = ["CAMERAS", "Filtered", "SimLingo"]

Filtered = Literal["published", "elapsed", "none"]
"""The choices of the position filter; see `SimLingo`."""

CAMERAS = rig("simlingo", width_px=256, height_px=128)
"""One wide camera above and behind the driver, at a quarter of the published resolution."""

_FULL_BRAKE = Control(brake=1.0)


class SimLingo(LearnedAgent):
    """One front camera, filtered position and raw speed in; a path, waypoints, maybe a sentence, and a control out.

    `commentary` lets the agent say its next action, and why, before planning (`said`). `instruction` is a sentence that
    the agent obeys for whole episodes: `"drive at 8 m/s"`, `"change lane to the left"` (all in
    `_nets.prompts.PHRASES`); with `safety` the agent may refuse the instruction.

    `position_filter` chooses the assumed pose of the vehicle, from which target points are seen:

    * `"published"`: the pose of the Kalman filter, which counts every call as 0.05 s, whatever the clock says;
    * `"elapsed"`: the pose of this filter with the true time between calls, by the observation's tick;
    * `"none"`: the pose of GPS and compass.

    The first two are equal to the bit while the agent acts in every tick. Both predict with the car of the embedded
    world, or with `tuning="published"` with the car of the published filter. The published numbers, made for this car,
    drive it better than ours.

    The other options are those of `LearnedAgent`. Raises `UsageError` for unknown sentences and filters.
    """

    consumes = frozenset({"cameras", "gps", "compass", "speed"})
    name = "simlingo"
    network_class = "simlingo:SimLingoNet"
    weights = tuple(
        SHIPPED / f"simlingo{rest}" for rest in (".safetensors", ".onnx", "_read.onnx", "_say.onnx", "_plan.onnx")
    )
    pictures: ClassVar[Mapping[str, Any]] = {"height_px": CAMERAS[0].height_px, "width_px": CAMERAS[0].width_px}
    drops_within_m = MIN_SIMLINGO_M
    tunings: ClassVar[Mapping[Tuning, PathTuning]] = {"ours": numbers.SIMLINGO, "published": numbers.SIMLINGO_PUBLISHED}

    def __init__(
        self,
        commentary: bool = False,
        instruction: str | None = None,
        *,
        safety: bool = False,
        position_filter: Filtered = "published",
        tuning: Tuning = "published",
        engine: str = "onnx",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
        network: Network | None = None,
    ) -> None:
        _require_filter(position_filter)
        self.position_filter = position_filter
        self.commentary, self.safety = commentary, safety
        self.instruction = _told(instruction, safety=safety)
        self._method = GENERATE if commentary else "forward"
        super().__init__(
            tuning=tuning, engine=engine, device=device, dtype=dtype, threads=threads,
            weights=weights, network=network,
        )  # fmt: skip

    @classmethod
    def check(cls, **options: Any) -> None:
        """Raise `UsageError` for unknown filters and sentences, and for the options that `LearnedAgent` refuses."""
        _require_filter(options.get("position_filter", "published"))
        _told(options.get("instruction"), safety=options.get("safety", False))
        super().check(**options)

    def sensors(self) -> Sequence[CameraSpec]:
        """Return one wide camera above and behind the driver."""
        return CAMERAS

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        super().reset(route, seed)
        self._filter = PositionFilter(mkz.moved if self.tuning == "ours" else published_motion)
        self._controller, self._creep = PathController(self.tunings[self.tuning]), Creep()
        self._last: Control | None = None
        self._tick: int | None = None
        self.said = ""
        """The last sentence: what it does and why; empty without commentary."""

    def _prepare(self, observation: Observation) -> NetworkRow:
        pose, speed_mps = self._pose(observation), observation.speed.mps
        targets = self._target(pose.x_m, pose.y_m).seen_from(pose.x_m, pose.y_m, pose.yaw_rad)
        inputs: dict[str, NDArray[Any]] = {
            "image": observation.cameras[CAMERAS[0].name].pixels,
            "speed": np.array(speed_mps, dtype=np.float32),
            "target": np.array(targets, dtype=np.float32),
            "prompt": np.array(prompt_row(self._prompt(speed_mps)), dtype=np.int64),
        }
        return NetworkRow(inputs, targets)

    def _pose(self, observation: Observation) -> PoseEstimate | SensedPose:
        """Return the assumed pose of the vehicle; call once per `act`, because the filter has a memory."""
        if self.position_filter == "none":
            return SensedPose.of(observation)
        before, self._tick = self._tick, observation.tick
        ticks = 1
        if before is not None and self.position_filter == "elapsed":
            ticks = max(1, observation.tick - before)
        gps, yaw_rad = observation.gps, observation.compass.yaw_rad
        last = self._last or _FULL_BRAKE
        return self._filter.step(gps.x_m, gps.y_m, yaw_rad, observation.speed.mps, last, ticks)

    def _prompt(self, speed_mps: float) -> str:
        way = by_targets(speed_mps)
        if self.instruction is not None:
            return instructed(way, self.instruction, safety=self.safety)
        return comment(way) if self.commentary else driving(way)

    def _control(
        self, observation: Observation, targets: tuple[Point, ...], outputs: Mapping[str, NDArray[Any]]
    ) -> Control:
        """Return the control: steer along the path, drive by the waypoints; brake in the first tick of an episode."""
        path, waypoints = (tuple((x, y) for x, y in outputs[name].tolist()) for name in ("path", "waypoints"))
        self._planned = PlannedPath(path=path, target_points=targets, speed_points=waypoints)
        if self.commentary:
            self.said = decode(number for number in outputs["answer"].tolist() if number != CLOSING)
        control = self._controller.step(path, waypoints, observation.speed.mps)
        if self._creep.step(observation.speed.mps):
            least = control.throttle if self.tuning == "published" else 0.0
            control = Control(max(Creep.THROTTLE, least), control.steer)
        self._last = _FULL_BRAKE if self._last is None else self._for_driven_car(control, observation.speed.mps)
        return self._last


def _told(instruction: str | None, *, safety: bool) -> Instruction | None:
    if instruction is None and safety:
        raise UsageError("safety=true of simlingo is for an instruction, and it has none that it could refuse.")
    return None if instruction is None else parse_instruction(instruction)


def _require_filter(name: str) -> None:
    if name not in get_args(Filtered):
        raise UnknownNameError.of("position_filter of simlingo", name, get_args(Filtered))
